"""What a base model lacks of an earlier record of the same test, taken off a later one: only what has changed is left.

A model of a measured cell is wrong by millivolts everywhere, in smooth curves that hide most effects. In a second
record of the same test on the same cell it is wrong by nearly the same.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..errors import BsaError
from ..trajectory import FloatArray, StepKind
from .observations import Observations
from .problem import UNSURE, Problem, largest_near
from .simulator import Simulator

_SMALL, _RESTS = 0.04, 0.01
"""Shares of the largest current: below the first one a current may be what an instrument shows at rest, and so far from
what it shows at rest a cell still rests. Holds end at 2 to 5 %."""


def without_known(
    simulator: Simulator,
    observations: Sequence[Observations],
    references: Sequence[Observations],
    candidate: dict[str, float],
) -> list[Observations]:
    """The averages of records less what the base model lacks of their references, as uncertain as that is.

    ``candidate`` are the values of the base model that both are compared at; of each reference the initial state of
    charge is fitted. Raises `BsaError` if a reference is of another test, or cannot be simulated.
    """
    found = Problem(simulator, observations, references).held_out((), candidate)
    if found is None:
        raise BsaError(
            "the base model cannot follow the current of a reference.",
            "leave --reference out, or begin with a run that fitted this cell.",
        )
    errors = [error for _, error in found[len(found) - len(references) :]]
    return [_less(*one) for one in zip(observations, references, errors, strict=True)]


def _less(observed: Observations, reference: Observations, error: FloatArray) -> Observations:
    """One record's averages less what the model lacks of its reference, V."""
    phases, earlier = _phases(observed), _phases(reference)
    if phases[-1] != earlier[-1]:
        raise BsaError(
            f"{observed.name} has {phases[-1] + 1} charges, discharges and rests, and its reference {reference.name} "
            f"{earlier[-1] + 1}.",
            "give an earlier record of the same test for each record, in their order; bsa data shows the steps.",
        )
    known = np.zeros(len(observed))
    for number in range(phases[-1] + 1):
        here, there = phases == number, earlier == number
        places = [_place(observed, here), _place(reference, there)]
        order = np.argsort(places[1], kind="stable")
        known[here] = np.interp(places[0], places[1][order], error[there][order])
    # As much as of a mesh correction, which is measured at one candidate too.
    unsure = UNSURE * largest_near(known)
    return replace(observed, voltage=observed.voltage - known, sigma=np.hypot(observed.sigma, unsure))


def _phases(observed: Observations) -> NDArray[np.intp]:
    """Number of the charge, discharge, rest or drive in which each average lies, from 0.

    A charge and the hold behind it are one: where the hold begins depends on the voltage, which may have changed.
    """
    steps = observed.measured_record.record.steps
    driven = np.array([step.kind is StepKind.DRIVE for step in steps])[observed.step]
    largest = np.max(np.abs(observed.current), initial=0.0)
    small = observed.current[np.abs(observed.current) < _SMALL * largest]
    flowing = observed.current - (np.median(small) if len(small) else 0.0)
    way = np.where(driven, 2.0, np.sign(flowing) * (np.abs(flowing) > _RESTS * largest))
    return np.cumsum(np.diff(way, prepend=way[:1]) != 0.0)


def _place(observed: Observations, inside: NDArray[np.bool_]) -> FloatArray:
    """Where the averages of a phase lie in it: the share of its charge, or the seconds since it began.

    The end of a discharge corresponds to the end of another one, whatever the cell has lost.
    """
    charge, time = observed.charge[inside], observed.time[inside]
    passed = np.abs(charge - charge[0])
    one_way = passed[-1] > 0.0 and np.all(np.diff(passed) >= 0.0)
    return np.asarray(passed / passed[-1] if one_way else time - time[0])
