"""Numbers, units and names as a reader wants to see them."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

from ...core.printable import counted

if TYPE_CHECKING:
    from ...core.parameters import Parameter

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_UNIT_IN_NAME = re.compile(r"\s*\[[^\[\]]*\]")
_POWER = re.compile(r"(?<=[A-Za-zΩ])-?\d+")

NOTHING = "–"


def number(value: float | None, digits: int = 4) -> str:
    """A number with few digits: ``0.01578``, ``3.3 × 10⁻¹⁴``; a dash for what is missing or not finite."""
    if value is None or not math.isfinite(value):
        return NOTHING
    if value == 0:
        return "0"
    exponent = math.floor(math.log10(abs(value)))
    if -4 <= exponent < 6:
        text = f"{value:.{digits}g}"
        text = f"{float(text):.0f}" if "e" in text else text
    else:
        mantissa, _, power = f"{value:.{digits - 1}e}".partition("e")
        mantissa = mantissa.rstrip("0").rstrip(".")
        text = f"{mantissa} × 10{str(int(power)).translate(_SUPERSCRIPT)}"
    return text.replace("-", "−")


def losses(unusable_replies: int, replies: int, lost_rounds: int) -> str:
    """``"18 of 18 replies could not be used, 6 rounds lost"``; empty where nothing was lost."""
    said = [f"{unusable_replies} of {replies} replies could not be used"] * bool(unusable_replies)
    said += [f"{counted(lost_rounds, 'round')} lost"] * bool(lost_rounds)
    return ", ".join(said)


def unit(text: str) -> str:
    """A unit in PyBaMM's notation, ``mol.m-3``, as it is printed: ``mol m⁻³``."""
    return _POWER.sub(lambda found: found.group().translate(_SUPERSCRIPT), text).replace(".", " ").replace("Ohm", "Ω")


def quantity(value: float | None, of_unit: str) -> str:
    """A value with its unit; short lengths in micrometres."""
    if value is not None and of_unit == "m" and 0 < abs(value) < 1e-3:
        return f"{number(value * 1e6)} µm"
    return f"{number(value)} {unit(of_unit)}".strip()


def printed_unit(parameter: Parameter) -> tuple[float, str]:
    """What a parameter's values are multiplied by where they are printed, and their unit then."""
    micro = parameter.unit == "m" and 0 < parameter.upper < 1e-2
    return (1e6, "µm") if micro else (1.0, unit(parameter.unit))


def short_name(parameter: str) -> str:
    """A parameter's name without its unit."""
    return _UNIT_IN_NAME.sub("", parameter) or parameter


def factor(before: float, after: float) -> str:
    """How many times larger: ``× 1.02``; a dash where that means nothing."""
    if not before or not math.isfinite(before) or not math.isfinite(after) or after / before <= 0:
        return NOTHING
    return f"× {number(after / before)}"


def change(before: float | None, after: float | None) -> str:
    """Relative change in percent: ``−93 %``; a dash where there is nothing to compare."""
    if before is None or after is None or not math.isfinite(before) or not math.isfinite(after) or before == 0:
        return NOTHING
    percent = 100.0 * (after / before - 1.0)
    if abs(percent) < 0.005:
        return "unchanged"
    if percent > 1000.0:
        return factor(before, after)
    if percent < -99.9999:
        return "−99.9999 % or more"
    return f"{percent:+.{_digits(percent)}f} %".replace("-", "−")


def share(value: float | None) -> str:
    """A share of 1 in percent: ``94 %``, ``99.93 %``; a dash where it is not known."""
    if value is None or not math.isfinite(value):
        return NOTHING
    percent = 100.0 * value
    if 99.9999 < percent < 100.0:
        return "more than 99.9999 %"
    return f"{percent:.{_digits(percent)}f} %".replace("-", "−")


def _digits(percent: float) -> int:
    """Digits behind the point; as many nines as it takes, for "100 %" would claim that nothing is left."""
    digits = 0 if abs(percent) >= 1 or percent == 0 else 2
    while 99.0 < abs(percent) < 100.0 and float(f"{abs(percent):.{digits}f}") == 100.0:
        digits += 1
    return digits


def duration(seconds: float) -> str:
    """A time span: ``0.4 s``, ``2 min 5 s``, ``1 h 20 min``."""
    if not math.isfinite(seconds):
        return NOTHING
    if seconds < 60:
        return f"{number(seconds, 3 if seconds >= 1 else 2)} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest} s"
    return f"{minutes // 60} h {minutes % 60} min"


def clipped(text: str, most: int) -> str:
    """The beginning and the end of a text that is longer than ``most`` characters."""
    if len(text) <= most:
        return text
    head = 2 * most // 3
    tail = text[len(text) - most + head :]
    return f"{text[:head]}\n… {len(text) - most} characters left out; journal.jsonl holds them …\n{tail}"


def time_unit(seconds: float) -> tuple[float, str]:
    """Seconds in the unit that suits so long a time, and the unit."""
    if seconds > 2.5 * 3600:
        return 3600.0, "h"
    return (60.0, "min") if seconds > 300 else (1.0, "s")
