"""Records, model and uncertainty as one vector of weighted residuals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.ndimage import maximum_filter1d

from ..comparison.robust_loss import robust
from ..contracts.requests import Prediction, Request, Simulator
from ..effect import Effect
from ..errors import BsaError
from ..parameters import Candidate, Parameter, ParameterSpace
from ..rms import rms
from ..trajectory import FloatArray
from .current_offset import current_offset
from .observations import Observations, subset
from .refit import refit
from .side_by_side import side_by_side

T = TypeVar("T")

_BLOCK = 6
"""Stretches that are held out together, where no whole record is."""

_HELD_BUDGET = 9
"""Simulations for each parameter that acts on a hold-out record alone, in which these are found at most."""

_SOC_LENGTH, _LARGEST_SOC = 0.02, 1.08
"""Unit of that fit's steps, and how far beyond full a cell may start."""

_ROOMY_SOC = 0.9
"""Where that fit starts if it cannot from the state of charge of another record."""

_LARGEST_V = 0.02
"""A larger difference between two meshes, V, is no correction: it counts as uncertainty only."""

UNSURE = 0.25
"""Share of a correction that is uncertain: it was measured at one candidate, that of the mesh at one refinement."""

_NEAR = 5
"""Averages in a row over which the largest difference between two meshes counts."""

_UNKNOWN_SOC = 0.5
"""Where the search for a hold-out record's initial state of charge starts when no fitted record has one."""

_EVERY, _USUAL_TURN = 5, 2
"""Each fifth block is held out, and which of five, unless too much of the curve's fall lies there."""

_FAIR = 2.0
"""Times its fair share of the voltage's changes that what is held out may hold: with the knee at the end of a discharge
in it, the test would be of little else."""


@dataclass(eq=False)
class Problem:
    """What is to be explained."""

    simulator: Simulator
    observations: Sequence[Observations]  # Averages of the fitted records.
    held_observations: Sequence[Observations] = ()  # Of hold-out records, of which the initial charge alone is fitted.
    # By record: what the finer mesh adds to the prediction, V. Applied to every prediction.
    corrections: dict[str, FloatArray] = field(default_factory=dict)
    mesh_sigma: dict[str, FloatArray] = field(default_factory=dict)
    # By record: which stretches are fitted. Left out, all are where there is a hold-out record; but of records of
    # many cycles every fifth block is held out in any case: a hold-out record of a cycle or two shows no ageing.
    fitted: Sequence[NDArray[np.bool_]] = ()
    low_fidelity: bool = False  # Whether the simulator's cheaper model predicts; see `shifted_low_fidelity`.
    misfit_v: float = 0.0
    """Added in quadrature to every deviation of a fit, V. While no model comes near the data, the priors of the
    parameters, and the flat parts of a record beside its steep ones, must count against the misfit, not the noise."""

    def __post_init__(self) -> None:
        if not self.fitted:
            self.fitted = [self._fitted_mask(observed) for observed in self.observations]
            if not self.held_observations and all(np.all(mask) for mask in self.fitted):
                raise BsaError(
                    f"the records have at most {_BLOCK} averages each: none can be held out to test what is found.",
                    "give a record that is not fitted with --holdout.",
                )
        self.stretches = [subset(*pair) for pair in zip(self.observations, self.fitted, strict=True)]
        """By record: the averages that are fitted."""
        self._held_start: dict[tuple[str, str], Candidate] = {}
        self._corrected_at: tuple[tuple[Effect, ...], dict[str, float]] | None = None
        records = [observed.measured_record for observed in (*self.observations, *self.held_observations)]
        self._names_of_records = frozenset(name for record in records for name in record.own_names)

    def _fitted_mask(self, observed: Observations) -> NDArray[np.bool_]:
        few = len(observed) <= _BLOCK  # all of one block
        if few or (self.held_observations and not observed.measured_record.is_long):
            return np.ones(len(observed), dtype=bool)
        turn = np.arange(len(observed)) // _BLOCK % _EVERY
        return np.asarray(turn != _held_turn(observed.voltage, turn), dtype=np.bool_)

    @property
    def noise_v(self) -> float:
        """Noise of one sample of the fitted records, V."""
        return rms(np.array([observed.noise for observed in self.observations]))

    @property
    def held_noise_v(self) -> float:
        """Noise of one sample of the data not fitted, V."""
        kept_back = [o for o, mask in zip(self.observations, self.fitted, strict=True) if not np.all(mask)]
        return rms(np.array([observed.noise for observed in (*kept_back, *self.held_observations)]))

    def side_by_side(self, actions: Sequence[Callable[[], T]]) -> list[T]:
        """What several actions return that wait for simulations of this problem; see `side_by_side`."""
        return side_by_side(actions, self.simulator.at_once)

    @property
    def simulated(self) -> float:
        """How many candidates the single simulations of this process come to; a journal answered for the others."""
        return (self.simulator.simulations - self.simulator.recalled) / len(self.observations)

    def predict(self, effects: Sequence[Effect], candidate: Candidate) -> list[Prediction] | None:
        """Predictions for the fitted records, corrected for the mesh; None if one of them fails."""
        return self.predict_all([(effects, candidate)])[0]

    def predict_all(self, wanted: Sequence[tuple[Sequence[Effect], Candidate]]) -> list[list[Prediction] | None]:
        """Predictions as by `predict` for several candidates, each with its effects, side by side."""
        found = iter(self._ask([(*one, observed) for one in wanted for observed in self.observations]))
        results = [[next(found) for _ in self.observations] for _ in wanted]
        return [None if None in result else [p for p in result if p is not None] for result in results]

    def _at_first_soc(
        self, effects: Sequence[Effect], candidate: Candidate, observed: Observations, fine: bool = False
    ) -> Prediction | None:
        """A prediction of any record; where its initial charge was not fitted, with that of the first fitted one."""
        own = {observed.measured_record.soc_name: self._first_soc(candidate), **candidate}
        return self._ask([(effects, own, observed)], fine)[0]

    def _ask(
        self, wanted: Sequence[tuple[Sequence[Effect], Candidate, Observations]], fine: bool = False
    ) -> Sequence[Prediction | None]:
        found = self.simulator.predict([self._request(*one, fine) for one in wanted])
        changes = [self.corrections.get(observed.name) for *_, observed in wanted]
        return [
            one if one is None or change is None else replace(one, voltage=one.voltage + change)
            for one, change in zip(found, changes, strict=True)
        ]

    def _request(self, effects: Sequence[Effect], candidate: Candidate, observed: Observations, fine: bool) -> Request:
        """The simulation of one record, without what acts on others: where that alone changes, it is the same."""
        record = observed.measured_record
        everywhere = {name: value for name, value in candidate.items() if name not in self._names_of_records}
        soc, offset = candidate.get(record.soc_name), candidate.get(record.offset_name, 0.0)
        fidelity = self.low_fidelity
        return Request(tuple(effects), everywhere, record, observed.moments, fine, soc, offset, fidelity)

    def errors(self, predictions: Sequence[Prediction]) -> list[FloatArray]:
        """Measured minus predicted voltage by record, V."""
        return [
            observed.voltage - prediction.voltage
            for observed, prediction in zip(self.observations, predictions, strict=True)
        ]

    def temperature_errors(self, predictions: Sequence[Prediction]) -> dict[str, FloatArray]:
        """Predicted minus measured temperature of the records that have one, K; no fit is ever shown it."""
        return {
            observed.name: prediction.temperature - observed.temperature
            for prediction, observed in zip(predictions, self.observations, strict=True)
            if prediction.temperature is not None and observed.temperature is not None
        }

    def fitted_errors(self, predictions: Sequence[Prediction]) -> FloatArray:
        """Measured minus predicted voltage of the fitted stretches, one record after the other, V."""
        errors = zip(self.errors(predictions), self.fitted, strict=True)
        return np.concatenate([error[mask] for error, mask in errors])

    @property
    def sigmas(self) -> list[FloatArray]:
        """Standard deviations of the fitted stretches by record, with what is uncertain about the mesh, V."""
        found = []
        for observed, mask in zip(self.observations, self.fitted, strict=True):
            mesh = self.mesh_sigma.get(observed.name)
            found.append((observed.sigma if mesh is None else np.sqrt(observed.sigma**2 + mesh**2))[mask])
        return found

    def systematic(self) -> FloatArray:
        """Errors of the fitted stretches that do not average out, V, each a column, shape (n, k).

        They are the floor, the same over a whole step, and in each record what is uncertain about the mesh and about
        what references have taken off.
        """
        blocks = []
        for observed, mask in zip(self.stretches, self.fitted, strict=True):
            floors = observed.floor * (observed.step[:, None] == np.unique(observed.step))
            mesh = UNSURE * self.corrections.get(observed.name, np.zeros(len(mask)))
            blocks.append(np.column_stack([floors, mesh[mask], observed.systematic]))
        return np.asarray(block_diag(*blocks))

    def deviation(self) -> FloatArray:
        """What the fitted stretches are weighed by, one after the other: deviations with the misfit, V."""
        return np.asarray(np.sqrt(np.concatenate(self.sigmas) ** 2 + self.misfit_v**2))

    def residuals(self, wanted: Sequence[tuple[Sequence[Effect], Candidate]]) -> list[FloatArray | None]:
        """Weighted residuals of the fitted stretches, misfit included, of several candidates, each with its effects.

        None where a simulation fails.
        """
        deviation = self.deviation()
        return [
            None if found is None else robust(self.fitted_errors(found)) / deviation
            for found in self.predict_all(wanted)
        ]

    @property
    def mesh_v(self) -> float:
        """Root mean square of the mesh correction, V."""
        changes = list(self.corrections.values())
        return rms(np.concatenate(changes)) if changes else 0.0

    def correct_mesh(self, effects: Sequence[Effect], candidate: Candidate) -> None:
        """Measure at one candidate what the mesh and the tolerances do to the voltage, and correct for it."""
        self._corrected_at = (tuple(effects), dict(candidate))
        for observed in (*self.observations, *self.held_observations):
            known = self.corrections.pop(observed.name, None)
            usual = self._at_first_soc(effects, candidate, observed)
            fine = self._at_first_soc(effects, candidate, observed, fine=True)
            if usual is None or fine is None:
                if known is not None:
                    self.corrections[observed.name] = known
                continue
            change = fine.voltage - usual.voltage
            # Voltages of two meshes cross, and a difference that is small by chance says nothing.
            near = largest_near(change)
            # Where the two meshes disagree on when the cell is empty, the difference is a shift in time: an uncertainty
            # and no correction.
            self.mesh_sigma[observed.name] = np.where(near > _LARGEST_V, near, UNSURE * near)
            self.corrections[observed.name] = np.where(near > _LARGEST_V, 0.0, change)

    def correct_mesh_anew(self, effects: Sequence[Effect], candidate: Candidate) -> bool:
        """Measure the mesh correction at another candidate; whether it moved by more than was uncertain of it.

        Where it was measured last it has not moved, and nothing is simulated.
        """
        if self._corrected_at == (tuple(effects), dict(candidate)):
            return False
        known, unsure = dict(self.corrections), dict(self.mesh_sigma)
        self.correct_mesh(effects, candidate)
        nothing = np.zeros(1)
        return any(
            np.mean((change - known.get(name, nothing)) ** 2) > np.mean(unsure.get(name, nothing) ** 2)
            for name, change in self.corrections.items()
        )

    def shifted_low_fidelity(self, effects: Sequence[Effect], candidate: Candidate) -> Problem | None:
        """The same problem on the simulator's cheaper model, shifted so that both models agree at one candidate.

        None where there is no such model, or one of the two cannot be simulated there.
        """
        if self.low_fidelity or not self.simulator.has_low_fidelity:
            return None
        low = replace(self, low_fidelity=True, corrections={})
        for observed in (*self.observations, *self.held_observations):
            ours, theirs = (one._at_first_soc(effects, candidate, observed) for one in (self, low))
            if ours is None or theirs is None:
                return None
            low.corrections[observed.name] = ours.voltage - theirs.voltage
        return low

    def _first_soc(self, candidate: Candidate) -> float:
        names = [observed.measured_record.soc_name for observed in self.observations]
        return next((candidate[name] for name in names if name in candidate), _UNKNOWN_SOC)

    def held_out(self, effects: Sequence[Effect], candidate: Candidate) -> list[tuple[Observations, FloatArray]] | None:
        """Errors (V) on data that was not fitted: the held-out stretches and, last, the hold-out records.

        A hold-out record's initial state of charge is not known either. It is fitted to the record, as that of
        each fitted record is, for every explanation alike; nothing else of the record is used.
        """
        result: list[tuple[Observations, FloatArray]] = []
        if not all(np.all(mask) for mask in self.fitted):
            predictions = self.predict(effects, candidate)
            if predictions is None:
                return None
            rows = zip(self.observations, self.fitted, self.errors(predictions), strict=True)
            result = [(subset(observed, ~mask), error[~mask]) for observed, mask, error in rows if not np.all(mask)]
        for observed in self.held_observations:
            error = self._held_error(effects, candidate, observed)
            if error is None:
                return None
            result.append((observed, error))
        return result

    def _held_error(self, effects: Sequence[Effect], candidate: Candidate, observed: Observations) -> FloatArray | None:
        """Errors (V) of a hold-out record with what acts on it alone fitted; None if it cannot be simulated."""
        record, weight = observed.measured_record, 1 / np.sqrt(observed.sigma**2 + self.misfit_v**2)

        def errors(states: Sequence[Candidate]) -> list[FloatArray | None]:
            found = self._ask([(effects, {**candidate, **state}, observed) for state in states])
            return [None if one is None else observed.voltage - one.voltage for one in found]

        def residuals(states: Sequence[Candidate]) -> list[FloatArray | None]:
            return [None if error is None else weight * robust(error) for error in errors(states)]

        key = (observed.name, " + ".join(effect.key for effect in effects))
        known = self._held_start.get(key, self._held_start.get((observed.name, ""), {}))
        offset = current_offset(record)
        for start in (known.get(record.soc_name, self._first_soc(candidate)), _ROOMY_SOC):
            soc = Parameter(record.soc_name, start, 0.0, _LARGEST_SOC, deviation=_SOC_LENGTH)
            space = ParameterSpace((soc,) if offset is None else (soc, offset))
            begin = np.array([0.0] if offset is None else [0.0, offset.coordinate(known.get(offset.name, 0.0))])
            fit = refit(residuals, space, begin, budget=_HELD_BUDGET * len(space))
            if fit is not None:
                self._held_start[key] = fit.candidate
                return errors([fit.candidate])[0]
        return None


def largest_near(change: FloatArray) -> FloatArray:
    """The largest size of a change of the voltage among some averages in a row, V."""
    return np.asarray(maximum_filter1d(np.abs(change), _NEAR))


def _held_turn(voltage: FloatArray, turn: NDArray[np.intp]) -> int:
    """Which of the blocks in turn is held out: the usual one, or that with the fairest share of the changes."""
    changes = np.bincount(turn, np.abs(np.gradient(voltage)), minlength=_EVERY)
    shares = _EVERY * changes / (np.sum(changes) or 1.0)
    there = np.unique(turn)
    usual = _USUAL_TURN in there and shares[_USUAL_TURN] <= _FAIR
    return _USUAL_TURN if usual else int(there[np.argmin(np.abs(shares[there] - 1.0))])
