"""Records that were not fitted: how well a fit predicts them, and how well its own intervals say that it should."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from ..ageing.fade_band import CAPACITY, FadeBand
from ..comparison.overlap import differences, scored_part, time_weights, weighted_rms
from ..comparison.record_errors import RecordErrors, errors_of_record
from ..encoding import decode_trajectory, encode_trajectory
from ..errors import BsaError
from ..normal import NORMAL_95
from ..parameters import Candidate
from ..reading.switches import begins_under_load
from ..rms import rms
from ..shape import shaped
from ..signals import Signal
from ..simulation import ExperimentRun, Outcome, in_order
from ..task import Experiment, Task
from ..thinning import SAMPLES_OF_DRIVES
from ..trajectory import FloatArray, Trajectory
from .identifiability import DRAWS_OF_A_LIFE
from .simulating import Simulating

HELD_OUT = "held-out"
"""Journal event that holds the predictions of the best trial."""

_SAMPLES_PER_STEP = 300
"""Samples of a step that a prediction's curve keeps, for drawing."""

_SAMPLES_OF_DRIVES = 5 * SAMPLES_OF_DRIVES
"""Samples of all its steps of a varying current: the residual that is drawn shall have the largest error of the table,
which a curve between fewer samples passes by. It is stored once, where a run stores a curve of each simulation."""

_WIDE = 0.1
"""Share of a signal's measured range: a band of as much predicts next to nothing."""

_STARTS_TRIED = 2
"""Simulations that move the start of a record until its beginning is met; each leaves about a tenth."""

_REST_SHARE = 0.5
"""Of the drop with which a simulation begins under load a record lacks all if its first sample is under load too, and
next to nothing if that is from before the load: half is between."""

_BEGINNING = 0.01
"""Share of a record that is its beginning: over a percent of its charge the open-circuit voltage hardly moves. Its very
first sample may have been taken before the current was switched on."""


@dataclass(frozen=True)
class Band:
    """Within what a fit promises one predicted signal, in its shown unit.

    Over the time in which the fitted cell follows the record: one that is empty, or full, shows its limit, and the
    draws, of which all may be empty too, say nothing of how far off that is.
    """

    # rms, max: Half the width of the 95 % band, root mean square over time and largest.
    rms: float
    max: float
    # Share of the time in which the measured signal lies in the band. Well below 0.95 says that the model is further
    # off here than in the records that were fitted.
    inside: float
    # Whether what the parameters leave open is a tenth of the measured range or more, most of the time.
    wide: bool = False
    # Half the width, median over the time: a cell that may run empty early widens the end of the band by volts.
    median: float = float("nan")
    # Of that half width what the fitted records are off by, 1.96 times their root-mean-square error: what the model
    # lacks there is taken to be lacking here. 0 where none of them has the signal.
    misfit: float = 0.0
    # Whether what the parameters leave open is wider than the range of the records, this one and the fitted ones, most
    # of the time: the fitted records do not determine the signal, and the width is no number to work with.
    undetermined: bool = False


@dataclass(frozen=True, eq=False)
class Prediction:
    """A record that was not fitted, as the fitted model predicts it."""

    errors: RecordErrors  # Of the record.
    bands: Mapping[str, Band]  # By signal; empty where the covariance is not known.
    # What was predicted, thinned, with half the width that the parameters give each band as a signal (`band_of`); None
    # if nothing was simulated.
    curve: Trajectory | None
    simulations: int = 0  # What the band and the start took, beside the prediction itself.
    fade: FadeBand | None = None  # Of a whole life the band of each cycle's capacity, beginning with the first.
    at_limit: tuple[tuple[float, float], ...] = ()  # `ExperimentRun.at_limit`: no band holds then.

    def as_json(self) -> dict[str, Any]:
        """Errors and bands as plain dicts, lists, strings and numbers; without the curve."""
        bands = {name: asdict(band) for name, band in self.bands.items()}
        at_limit = [list(times) for times in self.at_limit]
        return {**self.errors.as_json(), "bands": bands, "at_limit": at_limit, "simulations": self.simulations}


def band_of(signal: str) -> str:
    """Name under which a prediction's curve holds what the parameters leave open of a signal, in the signal's unit."""
    return f"{signal}_band"


def encode_prediction(prediction: Prediction) -> dict[str, Any]:
    """A prediction with its curve."""
    curve = None if prediction.curve is None else encode_trajectory(prediction.curve)
    fade = {} if prediction.fade is None else {"fade": asdict(prediction.fade)}
    return {**prediction.as_json(), "curve": curve, **fade}


def decode_prediction(content: Mapping[str, Any]) -> Prediction:
    """The inverse of `encode_prediction`.

    Raises `ValueError`, `LookupError`, `TypeError` or `BsaError` if the content is of another shape.
    """
    known = {name: content[name] for name in RecordErrors.__dataclass_fields__ if name in content}
    curve = content["curve"]
    return Prediction(
        RecordErrors.from_json(known),
        shaped(dict[str, Band], content["bands"]),
        None if curve is None else decode_trajectory(curve),
        int(content["simulations"]),
        shaped(FadeBand, content["fade"]) if "fade" in content else None,
        shaped(tuple[tuple[float, float], ...], content.get("at_limit", [])),
    )


def predict(
    task: Task,
    candidate: Candidate,
    experiments: Sequence[Experiment],
    simulating: Simulating,
    draws: Sequence[Sequence[float]] = (),
    misfits: Mapping[str, float] | None = None,
) -> tuple[Prediction, ...]:
    """Simulate records that were not fitted, and compare.

    ``draws``, of shape (n, p), are from the posterior of the fitted parameters in the unit box
    (`Identifiability.draws`): what they leave open is what one more simulation at each of them shows. ``misfits`` are
    root-mean-square errors of the fitted records by signal, in its shown unit (`record_errors.misfits`). Parameters and
    misfit are independent: the squares of what they add to a band's half width add up.

    Raises `BsaError` if the simulator knows the task alone.
    """
    misfits = misfits or {}
    chosen, spent = _meeting_beginnings(candidate, tuple(experiments), simulating)
    exact = _simulated([candidate], chosen, simulating, True)[0]
    moves: list[dict[str, FloatArray]] = [{}] * len(chosen)
    if len(draws):
        few = draws[:DRAWS_OF_A_LIFE] if task.long else draws
        moves = _spread(task, candidate, chosen, simulating, few, exact)
        spent += 1 + len(few)
    return tuple(
        (_forecast if experiment.long else _prediction)(task, experiment, run, moved, misfits, spent)
        for experiment, run, moved in zip(chosen, exact.runs, moves, strict=True)
    )


def _simulated(
    candidates: Sequence[Candidate], experiments: tuple[Experiment, ...], simulating: Simulating, exact: bool
) -> list[Outcome]:
    pairs = simulating.simulate_variant(candidates, experiments, exact)
    if pairs is None:
        raise BsaError(
            "this simulator simulates the records of its task alone, and predicts no others.",
            "leave the held-out records away, or give the simulator the hook simulate_variant.",
        )
    return in_order(pairs)


def _meeting_beginnings(
    candidate: Candidate, experiments: tuple[Experiment, ...], simulating: Simulating
) -> tuple[tuple[Experiment, ...], int]:
    """The experiments, those that begin under load started where the fitted cell shows their beginning.

    One that cannot be simulated from there starts where its first sample is its open-circuit voltage, and so does one
    that shows most of the drop that a cell shows which starts there: its first sample was taken before the load.
    """
    places = [
        place
        for place, experiment in enumerate(experiments)
        # Of a life the target's first cycle need not be the one that is simulated first.
        if experiment.initial_voltage is not None
        and not (experiment.long or experiment.is_spectrum)
        and begins_under_load(experiment.target)
    ]
    moved, at_rest, spent = list(experiments), set[int](), 0
    while places and spent < _STARTS_TRIED:
        outcome = _simulated([candidate], tuple(moved[place] for place in places), simulating, False)[0]
        spent += 1
        for place, run in zip(places, outcome.runs, strict=True):
            voltage = moved[place].initial_voltage
            if run.failure is None and run.trajectory is not None and voltage is not None:
                lacking = _lacking_at_first(run.trajectory, moved[place].target)
                if spent == 1 and abs(lacking) < _REST_SHARE * abs(voltage - float(run.trajectory.voltage[0])):
                    at_rest.add(place)
                else:
                    moved[place] = replace(moved[place], initial_voltage=voltage + lacking)
            else:
                moved[place] = experiments[place]
        places = [place for place in places if place not in at_rest]
    return tuple(moved), spent


def _lacking_at_first(simulated: Trajectory, measured: Trajectory) -> float:
    """Median of measured minus simulated voltage over the beginning of a record, V."""
    since = measured.time - measured.time[0]
    early = np.flatnonzero(since <= max(_BEGINNING * since[-1], since[min(2, len(since) - 1)]))
    predicted = np.interp(since[early], simulated.time - simulated.time[0], simulated.voltage)
    return float(np.median(measured.voltage[early] - predicted))


def _spread(
    task: Task,
    candidate: Candidate,
    experiments: tuple[Experiment, ...],
    simulating: Simulating,
    draws: Sequence[Sequence[float]],
    exact: Outcome,
) -> list[dict[str, FloatArray]]:
    """How far every observed signal moves with each draw, shape (n, d), on the samples of the exact simulation.

    Of a whole life how far the capacities of its cycles move.
    """
    candidates = [candidate, *(task.space.from_unit(np.array(draw)) for draw in draws)]
    outcomes = _simulated(candidates, experiments, simulating, False)
    moves: list[dict[str, FloatArray]] = []
    for place, (experiment, final) in enumerate(zip(experiments, exact.runs, strict=True)):
        fitted, *drawn = [_told(task, experiment, outcome.runs[place], final) for outcome in outcomes]
        others = [other for other in drawn if other]
        moved = {name: [other[name] - values for other in others] for name, values in fitted.items()}
        moves.append({name: np.array(changes).T for name, changes in moved.items() if changes})
    return moves


def _told(task: Task, experiment: Experiment, run: ExperimentRun, like: ExperimentRun) -> dict[str, FloatArray]:
    """What a run shows of every observed signal on the samples of another one; nothing if one of them failed.

    Of a whole life the capacities of its cycles, A.h; 0 where it has ended before.
    """
    ours, theirs = run.trajectory, like.trajectory
    if run.failure is not None or ours is None or theirs is None:
        return {}
    if experiment.long:
        assert ours.cycle_table is not None
        assert theirs.cycle_table is not None
        return {CAPACITY: np.nan_to_num(ours.cycle_table.at(theirs.cycle_table.cycle))}
    signals = task.observed_in(theirs)
    return {signal.name: np.interp(theirs.time, ours.time, ours.values(signal.name)) for signal in signals}


def _student(draws: int) -> float:
    """Half a 95 % band in deviations, where so many draws tell the deviation."""
    return float(student.ppf(0.975, draws))


def _forecast(
    task: Task,
    experiment: Experiment,
    run: ExperimentRun,
    moves: Mapping[str, FloatArray],
    misfits: Mapping[str, float],
    spent: int,
) -> Prediction:
    """A whole life, with the band of its capacities."""
    errors, whole, measured = errors_of_record(task, experiment, run), run.trajectory, experiment.target.cycle_table
    simulated = None if whole is None else whole.cycle_table
    if whole is None or simulated is None or measured is None or CAPACITY not in moves:
        return Prediction(errors, {}, None if whole is None else whole.thinned(_SAMPLES_PER_STEP), spent)
    count = moves[CAPACITY].shape[1]
    # Draws are directions of their own, of which each has the share of one; so few tell a deviation roughly.
    moved = moves[CAPACITY] * (_student(count) / NORMAL_95) / np.sqrt(count)
    own = np.eye(count).tolist()
    scatter_ah = 0.01 * misfits.get(CAPACITY, 0.0) * float(simulated.capacity_ah[0])
    fade = FadeBand.propagated(simulated.cycle, moved, own, scatter_ah)
    half = fade.at(measured.cycle)
    inside = np.abs(simulated.at(measured.cycle) - measured.capacity_ah) <= half
    percent = 100.0 / float(measured.capacity_ah[0])
    median = float(np.median(half))
    wide = median >= _WIDE * float(measured.capacity_ah[0])
    band = Band(
        percent * rms(half),
        percent * float(half.max()),
        float(np.mean(inside)),
        wide,
        percent * median,
        NORMAL_95 * percent * scatter_ah,
    )
    return Prediction(errors, {CAPACITY: band}, whole.thinned(_SAMPLES_PER_STEP), spent, fade)


def _prediction(
    task: Task,
    experiment: Experiment,
    run: ExperimentRun,
    moves: Mapping[str, FloatArray],
    misfits: Mapping[str, float],
    spent: int,
) -> Prediction:
    errors, whole = errors_of_record(task, experiment, run), run.trajectory
    if whole is not None:
        # Half the 95 % band about the fit, from what so many draws move.
        half = {name: _student(moved.shape[1]) * np.sqrt(np.mean(moved**2, axis=1)) for name, moved in moves.items()}
        whole = whole.changed(**{band_of(name): width for name, width in half.items()})
    simulated = scored_part(whole, experiment)
    if simulated is None:
        return Prediction(errors, {}, None, spent)
    bands = {
        signal.name: band
        for signal in task.observed_in(experiment.target)
        if signal.name in moves
        for band in [_band(task, simulated, run, experiment, signal, NORMAL_95 * misfits.get(signal.name, 0.0))]
        if band is not None
    }
    return Prediction(
        errors, bands, simulated.thinned(_SAMPLES_PER_STEP, _SAMPLES_OF_DRIVES), spent, at_limit=run.at_limit
    )


def followed(time: FloatArray, at_limit: Sequence[tuple[float, float]]) -> NDArray[np.bool_]:
    """At which times, s since a record's first sample, its simulated cell was at no limit; shape of ``time``."""
    follows = np.ones(len(time), dtype=np.bool_)
    for begin, end in at_limit:
        follows &= ~((time > begin) & (time <= end))
    return follows


def _band(
    task: Task, simulated: Trajectory, run: ExperimentRun, experiment: Experiment, signal: Signal, misfit: float
) -> Band | None:
    """The band of a signal, wider than what its parameters leave open by a misfit in the shown unit.

    None where the simulated cell was at its limit all the time.
    """
    scale = signal.shown_scale
    time, difference = differences(simulated, experiment.scored_target, signal.name, experiment.protocol is None)
    follows = followed(time, run.at_limit)
    weight = time_weights(time)[follows]
    if not np.sum(weight) > 0.0:
        return None
    time, difference = time[follows], difference[follows]
    left_open = scale * np.interp(time, simulated.time - simulated.time[0], simulated.values(band_of(signal.name)))
    half = np.hypot(left_open, misfit)
    inside = float(np.sum(weight[scale * np.abs(difference) <= half]) / np.sum(weight))
    open_half, measured = _median(weight, left_open), experiment.scored_target.values(signal.name)
    return Band(
        weighted_rms(weight, half),
        float(half.max()),
        inside,
        open_half >= _WIDE * scale * float(np.ptp(measured)),
        _median(weight, half),
        misfit,
        2 * open_half > scale * _range_of_records(task, experiment, signal),
    )


def _range_of_records(task: Task, predicted: Experiment, signal: Signal) -> float:
    """By how much a measured signal differs over the fitted records and a predicted one, in its own unit."""
    targets = [experiment.scored_target for experiment in (*task.experiments, predicted)]
    return float(
        np.ptp(np.concatenate([one.values(signal.name) for one in targets if signal in task.observed_in(one)]))
    )


def _median(weight: FloatArray, values: FloatArray) -> float:
    return float(np.quantile(values, 0.5, weights=weight, method="inverted_cdf"))
