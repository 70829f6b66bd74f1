"""What a base model lacks of an earlier record of the same test, taken off a later one: what has changed is left."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..contracts.requests import Simulator
from ..errors import BsaError
from ..trajectory import FloatArray, StepKind
from .observations import Observations
from .problem import UNSURE, Problem, largest_near

_SMALL, _RESTS = 0.04, 0.01
"""Shares of the largest current: below the first one a current may be what an instrument shows at rest, and so far from
what it shows at rest a cell still rests. Holds end at 2 to 5 %."""


def without_known(
    simulator: Simulator,
    observations: Sequence[Observations],
    references: Sequence[Observations],
    candidate: dict[str, float],
) -> list[Observations]:
    """The averages of records less what the base model lacks of their references (`lacking`), as uncertain as that is.

    ``references`` are one for each record, in their order, or several times as many: a first one for each record, then
    a second one.
    """
    found = lacking(simulator, observations, references, candidate)
    count = len(observations)
    return [less(observed, found[place::count]) for place, observed in enumerate(observations)]


def check_tests(observations: Sequence[Observations], references: Sequence[Observations]) -> None:
    """Raise `BsaError` if a reference is of another test than its record."""
    for place, reference in enumerate(references):
        observed = observations[place % len(observations)]
        phases, earlier = (int(_phases(one)[-1]) + 1 for one in (observed, reference))
        if phases != earlier:
            raise BsaError(
                f"{observed.name} has {phases} charges, discharges and rests, and its reference {reference.name} "
                f"{earlier}.",
                "give an earlier record of the same test for each record, in their order; bsa data shows the steps.",
            )


def lacking(
    simulator: Simulator,
    observations: Sequence[Observations],
    references: Sequence[Observations],
    candidate: dict[str, float],
) -> list[tuple[Observations, FloatArray]]:
    """What the base model lacks of each reference, V, at some values; its initial state of charge is fitted.

    Raises `BsaError` if one cannot be simulated.
    """
    found = Problem(simulator, observations, references).held_out((), candidate)
    if found is None:
        raise BsaError(
            "the base model cannot follow the current of a reference.",
            "leave --reference out, or begin with a run that fitted this cell.",
        )
    return found[len(found) - len(references) :]


def less(observed: Observations, lacked: Sequence[tuple[Observations, FloatArray]]) -> Observations:
    """One record's averages less what the model lacks of its references on average, V (`lacking`)."""
    each = np.array([_at_places_of(observed, reference, error) for reference, error in lacked])
    known, count = np.mean(each, axis=0), len(each)
    # As much as of a mesh correction, which is measured at one candidate too.
    unsure = UNSURE * known[None, :]
    if count > 1:
        # How far tests of the cell differ, and how far their mean is from what it would be over many.
        unsure = np.vstack([unsure, np.sqrt((1.0 + 1.0 / count) / (count - 1)) * (each - known)])
    sigma = np.hypot(observed.sigma, largest_near(np.linalg.norm(unsure, axis=0)))
    return replace(observed, voltage=observed.voltage - known, sigma=sigma, systematic=unsure.T)


def _at_places_of(observed: Observations, reference: Observations, error: FloatArray) -> FloatArray:
    """An error of a reference (V), in each charge, discharge and rest where the averages of a record lie in theirs."""
    phases, earlier = _phases(observed), _phases(reference)
    found = np.zeros(len(observed))
    for number in range(phases[-1] + 1):
        here, there = phases == number, earlier == number
        places = [_place(observed, here), _place(reference, there)]
        order = np.argsort(places[1], kind="stable")
        found[here] = np.interp(places[0], places[1][order], error[there][order])
    return found


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
