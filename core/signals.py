"""What is driven and what is observed: the channels that a record and its simulation share."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

from .errors import BsaError

Role = Literal["driven", "observed"]

ROLES: tuple[Role, ...] = get_args(Role)

_NAME = re.compile(r"[a-z][a-z0-9_]{0,39}")
_RESERVED = ("time", "steps")


@dataclass(frozen=True)
class Signal:
    """One channel of a record.

    Attributes
    ----------
    name : str
        Lower-case identifier, by which trajectories, features and errors name it: ``"displacement"``.
    unit : str
        Unit of its values and of its tolerance.
    tolerance : float
        Size of a mismatch that counts as one; not used for a signal that is never compared.
    role : {'observed', 'driven'}
        Whether the match is judged by it, or the experiment imposes it.
    label : str
        Name for people; by default the name with a capital.
    shown_unit : str
        Unit in which mismatches are printed, ``"mV"``; by default ``unit``.
    shown_scale : float
        How many shown units a unit is: 1000 for mV.
    relative : bool
        Whether the tolerance is a share of the value (with a tenth of the record's peak added, so that
        zero crossings count no more than the rest) rather than a number in ``unit``.
    share_of : str
        Name of the measured signal of whose value a relative tolerance is a share; by default this one.
    observed_in : tuple of str
        Kinds of steps of a protocol in which this driven signal is the one that answers, and is compared in
        place of the observed ones: the current of a voltage hold.
    optional : bool
        Whether a record may lack it: it is compared where a record has it.
    oscillates : bool
        Whether it swings about a mean within a step, so that amplitude and delay describe its mismatch
        better than a shift does.
    settles_s : float or None
        Seconds of a rest after which it shows the surroundings alone: a record under a measured drive is not fitted to
        it there.
    """

    name: str
    unit: str
    tolerance: float = 1.0
    role: Role = "observed"
    label: str = ""
    shown_unit: str = ""
    shown_scale: float = 1.0
    relative: bool = False
    share_of: str = ""
    observed_in: tuple[str, ...] = ()
    oscillates: bool = False
    settles_s: float | None = None
    optional: bool = False

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(self.name) or self.name in _RESERVED:
            raise BsaError(
                f'a signal is named "{self.name[:60]}".',
                f"use lower-case letters, digits and underscores, at most 40, and none of {list(_RESERVED)}.",
            )
        if self.role not in ROLES:
            raise BsaError(f'signal "{self.name}": the role is "{self.role}".', f"choose one of {list(ROLES)}.")
        for what, value in (("tolerance", self.tolerance), ("shown_scale", self.shown_scale)):
            if not (math.isfinite(value) and value > 0):
                raise BsaError(f'signal "{self.name}": {what} > 0 must hold, but got {value:g}.', "give its size.")

    @property
    def title(self) -> str:
        """Name for people, at the beginning of a line: ``"Displacement"``."""
        return self.label or self.name.replace("_", " ").capitalize()

    @property
    def words(self) -> str:
        """Name for people, within a sentence: ``"displacement"``."""
        return self.label or self.name.replace("_", " ")

    @property
    def shown(self) -> str:
        """Unit in which mismatches are printed."""
        return self.shown_unit or self.unit

    @property
    def suffix(self) -> str:
        """The shown unit as the end of a feature's name: ``"mv"``."""
        return slug(self.shown) or "1"

    def printed(self, value: float) -> str:
        """A value with its unit, to the decimals that the tolerance resolves."""
        if self.relative:
            return f"{value:.3g} {self.unit}".strip()
        decimals = min(max(-math.floor(math.log10(self.tolerance)), 0), 9)
        return f"{value:.{decimals}f} {self.unit}".strip()


def slug(text: str) -> str:
    """A text as part of an identifier: lower case, one underscore for everything else."""
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")


def observed(signals: Sequence[Signal]) -> tuple[Signal, ...]:
    """The signals that the match is judged by."""
    return tuple(signal for signal in signals if signal.role == "observed")


def driven(signals: Sequence[Signal]) -> tuple[Signal, ...]:
    """The signals that the experiment imposes."""
    return tuple(signal for signal in signals if signal.role == "driven")


def compared(signals: Sequence[Signal], kind: str, by_protocol: bool) -> tuple[Signal, ...]:
    """The signals that are compared in a step.

    Parameters
    ----------
    signals : sequence of Signal
        The task's.
    kind : str
        The step's kind.
    by_protocol : bool
        Whether the simulator ran a protocol; else the measured driven signals drove it, and only what is
        observed can differ.
    """
    answering = tuple(signal for signal in driven(signals) if by_protocol and kind in signal.observed_in)
    return answering or observed(signals)
