"""What a column of temperatures may hold: gaps, readings of a faulty sensor, or another unit than the file says."""

from dataclasses import replace

import numpy as np
from scipy.constants import zero_Celsius

from ..errors import BsaError
from ..printable import counted, were
from ..trajectory import FloatArray
from .samples import Mask, Samples
from .values import lone

KELVIN = (200.0, 400.0)
"""Temperatures at which a cell is measured; outside, the unit is another one or the sensor is faulty."""

_NEAR_ZERO_K = 5.0
"""What an open sensor reads as -273 degC, K: within this of the absolute zero nothing else is meant."""

_GLITCH_K, _GLITCH_S = 20.0, 60.0
"""A lone reading this far from both neighbours, which agree and lie this near in time, is a glitch: cells warm by 3 to
15 K in a whole discharge at 1C, and cool in minutes."""

_MISSING_SHARE = 0.1
"""Temperatures are interpolated up to this share of the record; beyond, the column is not used."""

_SHOWN = 5


def with_usable_temperature(samples: Samples) -> Samples:
    """Interpolate the few temperatures that are missing or that no cell has; a column with many of them is not used.

    Raises `BsaError` with the option that names the unit where the values are those of another unit.
    """
    temperature = samples.temperature
    if temperature is None or len(samples) == 0:
        return samples
    finite = np.isfinite(temperature)
    if not finite.any():
        return _without(samples, f"has no number in {len(samples)} of {len(samples)} rows")
    median = float(np.median(temperature[finite]))
    if not _is_possible(median):
        _refuse_other_unit(samples, median)
        return _without(
            samples,
            f"shows {_words(median)}, which is no temperature of a cell in degC or in K (an open sensor reads so)",
        )
    impossible = (temperature < KELVIN[0]) | (temperature > KELVIN[1])
    faulty = finite & (impossible | _glitches(samples.time, temperature))
    bad = ~finite | faulty
    if np.count_nonzero(bad) > _MISSING_SHARE * len(samples):
        k = int(np.argmax(faulty))
        first = f"first {temperature[k] - zero_Celsius:.5g} degC in {samples.place(k)}"
        what = f"no temperature of a cell ({first})" if faulty.any() else "no number"
        return _without(samples, f"has {what} in {np.count_nonzero(bad)} of {len(samples)} rows")
    return _interpolated(samples, temperature, ~finite, faulty)


def _without(samples: Samples, why: str) -> Samples:
    return replace(samples, temperature=None).noted(f"column {samples.column('temperature')} {why}; it is not used.")


def _interpolated(samples: Samples, temperature: FloatArray, missing: Mask, faulty: Mask) -> Samples:
    bad = missing | faulty
    if not bad.any():
        return samples
    filled = temperature.copy()
    filled[bad] = np.interp(np.flatnonzero(bad), np.flatnonzero(~bad), temperature[~bad])
    if missing.any():
        rows = np.flatnonzero(missing)
        samples = samples.noted(
            f"{counted(len(rows), 'missing temperature')} {were(len(rows))} interpolated ({samples.places(rows)})."
        )
    if faulty.any():
        rows = np.flatnonzero(faulty)
        values = ", ".join(dict.fromkeys(f"{temperature[row] - zero_Celsius:.5g} degC" for row in rows[:_SHOWN]))
        samples = samples.noted(
            f"{counted(len(rows), 'temperature')} that no cell has {were(len(rows))} interpolated "
            f"({values} in {samples.places(rows)}): is the sensor loose?"
        )
    return replace(samples, temperature=filled)


def _is_possible(kelvin: float) -> bool:
    return KELVIN[0] <= kelvin <= KELVIN[1]


def _glitches(time: FloatArray, kelvin: FloatArray) -> Mask:
    """Which readings are glitches: see `_GLITCH_K`."""
    found, apart = lone(kelvin, _GLITCH_K), np.diff(time)
    found[1:-1] &= np.maximum(apart[:-1], apart[1:]) <= _GLITCH_S
    return found


def _refuse_other_unit(samples: Samples, kelvin: float) -> None:
    """Refuse temperatures that are possible in the other unit."""
    if kelvin > _NEAR_ZERO_K and _is_possible(kelvin + zero_Celsius):
        other = "degC"
    elif _is_possible(kelvin - zero_Celsius):
        other = "K"
    else:
        return
    raise BsaError(
        f"{samples.source}: column {samples.column('temperature')} shows {_words(kelvin)}, which cannot be.",
        f"is it in {other}? Then say --unit temperature={other}.",
    )


def _words(kelvin: float) -> str:
    return f"{kelvin - zero_Celsius:.4g} degC ({kelvin:.4g} K)"
