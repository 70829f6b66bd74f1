"""What a base model lacks of an earlier record of the same test, taken off a later one: only what has changed is left.

A model of a measured cell is wrong by millivolts everywhere, in smooth curves that hide most effects. In a second
record of the same test on the same cell it is wrong by nearly the same.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from ..errors import BsaError
from ..trajectory import FloatArray, StepKind
from .observations import Observations
from .problem import Problem
from .simulator import MeasuredRecord, Simulator

_UNSURE = 0.25
"""Share of what the model lacks of the earlier record that is uncertain of the later one: as much as of a mesh
correction, which is measured at one candidate too."""

_NEAR = 5
"""Averages in a row over which the largest of it counts: a step ends earlier or later in another record."""

_ON_TIME = (StepKind.REST, StepKind.CV_HOLD, StepKind.DRIVE)
"""Steps whose moments correspond by their time; those of others by the share of their charge."""


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
    for observed, reference in zip(observations, references, strict=True):
        check_same_test(observed.measured_record, reference.measured_record)
    found = Problem(simulator, observations, references).held_out((), candidate)
    if found is None:
        raise BsaError(
            "the base model cannot follow the current of a reference.",
            "leave --reference out, or begin with a run that fitted this cell.",
        )
    errors = [error for _, error in found[len(found) - len(references) :]]
    return [_less(*one) for one in zip(observations, references, errors, strict=True)]


def check_same_test(later: MeasuredRecord, earlier: MeasuredRecord) -> None:
    """Refuse an earlier record that has other steps."""
    counts = [len(one.record.steps) for one in (later, earlier)]
    if counts[0] != counts[1]:
        raise BsaError(
            f"{later.name} has {counts[0]} steps, and its reference {earlier.name} {counts[1]}.",
            "give a record of the same test for each record, in their order; bsa data shows the steps.",
        )


def _less(observed: Observations, reference: Observations, error: FloatArray) -> Observations:
    """One record's averages less what the model lacks of its reference, V."""
    known = np.zeros(len(observed))
    for number in np.unique(observed.step):
        here, there = observed.step == number, reference.step == number
        if not np.any(there):
            continue
        kind = observed.measured_record.record.steps[number].kind
        places = [_place(one, inside, kind) for one, inside in ((observed, here), (reference, there))]
        order = np.argsort(places[1], kind="stable")
        known[here] = np.interp(places[0], places[1][order], error[there][order])
    unsure = _UNSURE * maximum_filter1d(np.abs(known), _NEAR)
    return replace(observed, voltage=observed.voltage - known, sigma=np.hypot(observed.sigma, unsure))


def _place(observed: Observations, inside: NDArray[np.bool_], kind: StepKind) -> FloatArray:
    """Where the averages of a step lie in it: seconds since its beginning, or the share of its charge."""
    charge = np.abs(observed.charge[inside] - observed.charge[inside][0])
    if kind in _ON_TIME or charge[-1] == 0.0:
        return np.asarray(observed.since[inside])
    return np.asarray(charge / charge[-1])
