"""A run record: what a journal tells, in plain data that reports, campaigns and the command line share."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..core.comparison.record_errors import RecordErrors
from ..core.encoding import decode_task, decode_trial
from ..core.errors import BsaError
from ..core.inference.post_fit_analysis import PostFitAnalysis
from ..core.inference.prediction import HELD_OUT, Prediction, decode_prediction
from ..core.messages import Usage
from ..core.metrics import Metrics, decode_metrics
from ..core.offered_effects import as_found, of_the_found
from ..core.parameters import Parameter
from ..core.proposal import CHANGED_FROM, LACKING, unusable_replies
from ..core.run.after_search import ANALYSIS, NO_BAND, NOT_ANALYSED, NOT_PREDICTED, SCORE, read_record_errors
from ..core.run.answer import answer
from ..core.run.budget import BUDGET, since_budget, with_budget
from ..core.run.journal import FILE_NAME, check_calibration, read_events
from ..core.run.low_fidelity import LOW_FIDELITY
from ..core.shape import decoding, mapping_with, shaped
from ..core.task import Task
from ..core.trial import Phase, Trial, lowest, repeated_by
from .exchanges import EXCHANGED, Exchange, exchange_of

_AFTER_A_DISCOVERY = (
    "augmented_model.py in it is the fitted cell with what was found; to predict, export or begin from such a cell, "
    "calibrate it first: bsa run --data FILE --parameters NAME --effect EFFECT."
)

UNFINISHED = "unfinished"
"""Status of a run that is still going on, or was killed."""


@dataclass(frozen=True, eq=False)
class Round:
    """One proposal with what led to it and what came of it."""

    phase: Phase  # The phase it belongs to.
    number: int  # The round of its phase, from 1.
    # hypothesis, rationale, action, lost: As in `Proposal`. Untrusted.
    hypothesis: str
    rationale: str
    action: str
    updates: Mapping[str, str]  # The changes as they were proposed.
    details: Mapping[str, Any]  # Whatever else the proposer kept.
    lost: str
    finished: bool  # Whether the proposer asked to stop.
    base: Trial  # The trial with the lowest objective before this round.
    changed_from: Trial  # The trial whose values its candidates change: `base` where the proposer names none.
    trials: tuple[Trial, ...]  # The candidates that were tried, in order; empty for a lost round.
    repeats: Mapping[int, int]  # Simulations of values that were simulated before, with the number of the earlier one.
    # The calls of the language model that led to the proposal, votes and reviews among them.
    exchanges: tuple[Exchange, ...]

    @property
    def best(self) -> Trial | None:
        """The best of this round's trials by the objective; None for a lost round."""
        return lowest(self.trials) if self.trials else None

    @property
    def improved(self) -> bool:
        """Whether the round found a lower objective than any before it."""
        return self.best is not None and self.best.objective < self.base.objective


@dataclass(frozen=True, eq=False)
class RunRecord:
    """Everything a journal tells of a run."""

    name: str  # Name of the run's folder.
    task: Task  # What was matched, with those alone of the effects that it was offered which the answer has.
    config: Mapping[str, Any]  # The run's configuration, as `RunConfig` writes it.
    versions: Mapping[str, str]  # What was installed when the run began.
    identity: str  # Hash of task, configuration and versions.
    status: str  # Why it ended, or `UNFINISHED`.
    trials: tuple[Trial, ...]  # Everything that was tried, by index.
    rounds: tuple[Round, ...]  # Every proposal, warm-up included, in order.
    # Every call of the language model, votes and reviews among them, those of a round that was cut off included.
    exchanges: tuple[Exchange, ...]
    best: Trial  # The trial whose parameters and intervals are the run's answer; the initial one if all failed.
    # Metrics of reference accuracy by trial, as far as they were computed.
    scores: Mapping[int, Metrics | None] = field(default_factory=dict)
    notes: tuple[str, ...] = ()  # What the run had to say, task's assumptions first.
    resumed: int = 0  # How often it was taken up again.
    analysis: PostFitAnalysis | None = None  # What the records fix, if the run looked.
    # Of the best trial, record by record, where it was scored with reference accuracy.
    records: tuple[RecordErrors, ...] = ()
    initial_records: tuple[RecordErrors, ...] = ()  # The same of the starting point.
    held_out: tuple[Prediction, ...] = ()  # Of the records that were not fitted, in the order of the task's.
    # low_fidelity_simulations, low_fidelity_s: Simulations by a low-fidelity model, and their time.
    low_fidelity_simulations: int = 0
    low_fidelity_s: float = 0.0

    @property
    def initial(self) -> Trial:
        """The task's starting point."""
        return self.trials[0]

    @property
    def simulator(self) -> str:
        """The name of what simulated."""
        return str(self.config["scaffold"].get("simulator", {}).get("use", "pybamm"))

    @property
    def lowest(self) -> Trial:
        """The trial with the lowest objective, of those with the effects of the task; the initial one if all failed."""
        names = set(self.task.space.names)
        return lowest([trial for trial in self.trials if names.issuperset(trial.candidate)])

    def metrics_of(self, trial: Trial) -> Metrics | None:
        """Of reference accuracy where there is a score, else of the search."""
        return self.scores.get(trial.index, trial.metrics)

    @property
    def initial_metrics(self) -> Metrics | None:
        """Errors of the starting point; see `metrics_of`."""
        return self.metrics_of(self.initial)

    @property
    def best_metrics(self) -> Metrics | None:
        """Errors of the run's answer; see `metrics_of`."""
        return self.metrics_of(self.best)

    @property
    def lacking(self) -> str:
        """What a finished search left out for lack of simulations, in a sentence; empty where nothing. Untrusted."""
        last = self.rounds[-1] if self.rounds else None
        return str(last.details.get(LACKING, "")) if last is not None and last.finished else ""

    @property
    def scored_exactly(self) -> bool:
        """Whether the best trial was scored with reference accuracy."""
        return self.best.index in self.scores

    @property
    def failed(self) -> int:
        """How many simulations failed."""
        return sum(trial.failed for trial in self.trials)

    @property
    def calls(self) -> int:
        """How often the language model was called."""
        return sum(exchange.made_by == "model" for exchange in self.exchanges)

    @property
    def lost_calls(self) -> int:
        """How many of these calls gave no reply."""
        return sum(bool(exchange.lost) for exchange in self.exchanges)

    @property
    def unusable_replies(self) -> int:
        """How many replies of the language model could not be used."""
        return sum(unusable_replies(round_.details) for round_ in self.rounds)

    @property
    def lost_rounds(self) -> int:
        """How many rounds came to no candidate for that, or for want of a reply."""
        return sum(bool(round_.lost) for round_ in self.rounds)

    @property
    def usage(self) -> Usage:
        """Tokens, cost and time of the language model."""
        return sum((exchange.usage for exchange in self.exchanges), Usage())

    @property
    def simulator_s(self) -> float:
        """Time of all simulations, s; those that ran side by side are added up."""
        return sum(trial.seconds for trial in self.trials) + self.low_fidelity_s


def read_run(folder: Path) -> RunRecord:
    """Read the journal of a finished, interrupted or running run.

    Raises `BsaError` if there is no journal, it is damaged, or not even the first simulation was finished.
    """
    events = list(read_events(folder))
    check_calibration(events[0] if events else {}, folder / FILE_NAME, _AFTER_A_DISCOVERY)
    with decoding(folder / FILE_NAME, "a run", "restore the file, or start a new run."):
        return _record(folder, events)


def _record(folder: Path, events: list[dict[str, Any]]) -> RunRecord:
    first = events[0]
    found = {event["index"]: event for event in events if event["event"] == "trial"}
    trials = tuple(decode_trial(found[index], folder) for index in sorted(found))
    if [trial.index for trial in trials if trial.index >= 0] != sorted(found):
        raise ValueError("a simulation has a number below 0")
    if not trials or trials[0].index != 0:
        raise BsaError(f"{folder} holds no finished simulation yet.", "wait for the first one, or resume the run.")
    asked = decode_task(first["task"])
    shaped(_CONFIG, first["config"])
    for trial in trials:
        for parameter in asked.space:
            _check_bounds(parameter, trial.candidate[parameter.name])
    best = answer(asked, trials).index
    task = as_found(asked, next(trial for trial in trials if trial.index == best))
    comparable = {trial.index: trial for trial in of_the_found(asked, task, trials)}
    trials = tuple(comparable.get(trial.index, trial) for trial in trials)
    scores = {event["index"]: event for event in events if event["event"] == SCORE}
    latest = since_budget(events)
    analysis, held_out = _analysis(latest, best, task), _predictions(latest, best)
    resolved = {
        NOT_ANALYSED: analysis is not None,
        NOT_PREDICTED: bool(held_out),
        NO_BAND: any(one.bands for one in held_out),
    }
    told = _notes(events)
    low_fidelity = [float(event["seconds"]) for event in events if event["event"] == LOW_FIDELITY]
    return RunRecord(
        name=folder.resolve().name,
        task=task,
        config=with_budget(first["config"], events),
        versions=first.get("versions", {}),
        identity=str(first.get("identity", "")),
        status=_status(events),
        trials=trials,
        best=comparable[best],
        rounds=_rounds(events, trials),
        exchanges=tuple(exchange_of(event) for event in events if event["event"] in EXCHANGED),
        scores={index: decode_metrics(event["metrics"]) for index, event in scores.items()},
        notes=(*task.notes, *(text for text in told if not resolved.get(text))),
        resumed=sum(event["event"] == "resumed" for event in events),
        analysis=analysis,
        records=read_record_errors(scores.get(best, {})),
        initial_records=read_record_errors(scores.get(0, {})),
        held_out=held_out,
        low_fidelity_simulations=len(low_fidelity),
        low_fidelity_s=sum(low_fidelity),
    )


def _check_bounds(parameter: Parameter, value: float) -> None:
    if not math.isclose(value, parameter.project(value), rel_tol=1e-9):
        raise ValueError(f'"{parameter.name}" is {value:g}, outside its bounds')


_CONFIG = mapping_with(scaffold=mapping_with(name=str), backend=str, seed=int)
"""What a report tells of a configuration."""


def _analysis(events: Iterable[Mapping[str, Any]], base: int, task: Task) -> PostFitAnalysis | None:
    """The analysis about the most likely trial: a resumed run may have found a likelier one since."""
    found = (event["appraisal"] for event in events if event["event"] == ANALYSIS)
    analysis = next((PostFitAnalysis.from_json(content) for content in found if content["base"] == base), None)
    for name, interval in () if analysis is None else analysis.identifiability.intervals.items():
        for end in (interval.value, interval.lower, interval.upper) if name in task.space else ():
            _check_bounds(task.space[name], end)
    return analysis


def _predictions(events: Iterable[Mapping[str, Any]], best: int) -> tuple[Prediction, ...]:
    """The last predictions of the best trial: a resumed run may have found a better one since, or their bands."""
    found = [event["predictions"] for event in events if event["event"] == HELD_OUT and event["base"] == best]
    return tuple(decode_prediction(content) for content in (found[-1] if found else ()))


def _notes(events: Iterable[Mapping[str, Any]]) -> list[str]:
    """What the run said, each once; what it said of an end that a larger budget took back is left out."""
    notes: list[str] = []
    kept: int | None = None
    for event in events:
        if event["event"] == "note":
            notes.append(str(event["text"]))
        elif event["event"] == "end":
            kept = len(notes)
        elif event["event"] == BUDGET and kept is not None:
            del notes[kept:]
    return list(dict.fromkeys(notes))


def _status(events: list[dict[str, Any]]) -> str:
    """The last word on how the run ended; taking it up again takes that word back."""
    last: Mapping[str, Any] = next((event for event in reversed(events) if event["event"] in ("end", "resumed")), {})
    return str(last["status"]) if last.get("event") == "end" else UNFINISHED


def _rounds(events: Iterable[Mapping[str, Any]], trials: tuple[Trial, ...]) -> tuple[Round, ...]:
    rounds: list[Round] = []
    exchanges: list[Exchange] = []
    best = trials[0]
    for event in events:
        if event["event"] in EXCHANGED:
            exchanges.append(exchange_of(event))
        elif event["event"] == "proposal":
            phase, number = event["phase"], event["round"]
            mine = tuple(trial for trial in trials if (trial.phase, trial.round) == (phase, number))
            repeats = {trial.index: earlier.index for trial in mine if (earlier := repeated_by(trial, trials))}
            changed_from = event["details"].get(CHANGED_FROM)
            rounds.append(
                Round(
                    **{name: event[name] for name in _PROPOSED},
                    number=number,
                    base=best,
                    changed_from=next((trial for trial in trials if trial.index == changed_from), best),
                    trials=mine,
                    repeats=repeats,
                    exchanges=tuple(exchanges),
                )
            )
            exchanges = []
            best = lowest((best, *mine))
    return tuple(rounds)


_PROPOSED = ("phase", "hypothesis", "rationale", "action", "updates", "details", "lost", "finished")
"""What a round takes over from the event of its proposal."""
