"""What a run finds out when its search has ended: final scores, what the records fix, and records that were not fitted.

All of it is journalled: a run that is interrupted here goes on where it was.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import InitVar, dataclass
from typing import Any

from ..comparison.record_errors import RecordErrors, errors_by_record, misfits
from ..inference.post_fit_analysis import PostFitAnalysis, analyse
from ..inference.prediction import HELD_OUT, Prediction, decode_prediction, encode_prediction, predict
from ..metrics import Metrics, decode_metrics, evaluate
from ..simulation import Outcome
from ..task import Task
from ..trial import Trial
from .budget import since_budget
from .journal import Journal
from .later_simulations import (
    ANALYSIS_SIMULATION,
    BAND,
    FORECAST,
    NOT_FITTED,
    REFERENCE,
    JournalledSimulations,
    WatchedSimulations,
    simulated,
)
from .listener import SILENT, Listener
from .run_plugins import RunPlugins

ANALYSIS, SCORE = "appraisal", "score"
"""Events of the journal; the first is called as it was when journals began."""

NOT_ANALYSED = "Stopped before it was known what the record fixes. Resume the run to find out."
NOT_PREDICTED = "Stopped before the held-out records were scored. Resume the run to score them."
NO_BAND = "Stopped before the band of the forecast was known. Resume the run to find out."
"""Notes of a run that was interrupted after its search; no longer true once it was taken up again."""


@dataclass(frozen=True)
class Score:
    """A trial, scored with the simulator's reference accuracy."""

    metrics: Metrics | None  # Its errors; None where nothing could be compared.
    records: tuple[RecordErrors, ...] = ()  # Record by record; empty where it did not run with that accuracy.


@dataclass(eq=False)
class AfterSearch:
    """The steps of a run after its search. What the events of an interrupted run hold is not found out again."""

    task: Task
    plugins: RunPlugins
    journal: Journal
    earlier: InitVar[Sequence[Mapping[str, Any]]]
    listener: Listener = SILENT

    def __post_init__(self, earlier: Sequence[Mapping[str, Any]]) -> None:
        self.cut_short = False
        """Whether a person interrupted it: what is lacking is found out when the run is taken up again."""
        self._simulated: list[Mapping[str, Any]] = [event for event in earlier if event["event"] == ANALYSIS_SIMULATION]
        self._scores = {event["index"]: event for event in earlier if event["event"] == SCORE}
        # With another budget the search has made other simulations, from which intervals and bands are drawn.
        latest = since_budget(earlier)
        self._analyses = {event["appraisal"]["base"]: event for event in latest if event["event"] == ANALYSIS}
        self._predictions: dict[int, Mapping[str, Any]] = {
            event["base"]: event for event in latest if event["event"] == HELD_OUT
        }

    def score(self, trials: Iterable[Trial]) -> dict[int, Score]:
        """Score trials with the simulator's reference accuracy; each is simulated once, however often it is given."""
        wanted = {trial.index: trial for trial in trials}
        scores = {
            index: Score(decode_metrics(known["metrics"]), read_record_errors(known))
            for index, known in self._scores.items()
            if index in wanted
        }
        missing = [trial for index, trial in wanted.items() if index not in scores]
        if missing:
            simulations = WatchedSimulations(self.plugins, self.listener.counted)
            for place, outcome in simulations.simulate([trial.candidate for trial in missing], True):
                scores[missing[place].index] = self._scored(missing[place], outcome)
                if self.task.long:
                    # The analysis asks for that of the best trial again, and every cycle of a life takes minutes.
                    self._simulated.append(simulated(missing[place].candidate, outcome, exact=True))
        return scores

    def _scored(self, trial: Trial, outcome: Outcome) -> Score:
        metrics = evaluate(self.task, outcome) if outcome.ok else None
        if metrics is None and trial.ok:
            self._note(
                f"Simulation {trial.index} ran on the search mesh but not with reference accuracy "
                f"({outcome.failure.cause if outcome.failure else 'nothing to compare'}); its search score stands."
            )
            metrics = trial.metrics
        records = errors_by_record(self.task, outcome) if outcome.ok else ()
        self.journal.append(
            SCORE,
            index=trial.index,
            metrics=None if metrics is None else metrics.as_json(),
            records=[record.as_json() for record in records],
        )
        return Score(metrics, records)

    def known_analysis(self, best: Trial) -> PostFitAnalysis | None:
        """What the records fix at the best trial, if it was found out before."""
        known = self._analyses.get(best.index)
        return None if known is None else PostFitAnalysis.from_json(known["appraisal"])

    def analyse(self, trials: Sequence[Trial], best: Trial, budget: int) -> PostFitAnalysis | None:
        """What the records fix at the best trial; from the journal if it was found out before."""
        known = self.known_analysis(best)
        if known is not None or self.cut_short:
            return known
        if best.ok:
            self.listener.noted("The search has ended; now what the record fixes, and what to measure next.")
        try:
            simulating = self._journalled(exact=REFERENCE)
            found = analyse(self.task, trials, best, simulating, budget, self.plugins.weighs_priors())
        except KeyboardInterrupt:
            self.cut_short = True
            self._note(NOT_ANALYSED)
            return None
        if found is not None:
            self.journal.append(ANALYSIS, appraisal=found.as_json())
        return found

    def forecast(self, best: Trial) -> tuple[Prediction, ...]:
        """The rest of a life, before it is known what the records fix: what that adds is its band.

        Nothing if it was predicted before, or the task is no life.
        """
        if not self.task.long or best.index in self._predictions:
            return ()
        return self.predict(best, None)

    def predict(
        self, best: Trial, analysis: PostFitAnalysis | None, fitted: Sequence[RecordErrors] = ()
    ) -> tuple[Prediction, ...]:
        """The held-out records at the best trial's parameters, given the errors of those that were fitted."""
        if not (best.ok and self.task.held_out):
            return ()
        known = self._predictions.get(best.index)
        before = () if known is None else tuple(decode_prediction(content) for content in known["predictions"])
        draws = () if analysis is None else analysis.identifiability.draws
        # Those from before the posterior was known have no bands yet.
        lacking = known is None or (draws and known.get("draws") == 0)
        if self.cut_short or not lacking:
            return before
        # A life takes minutes for each simulation of its band: none is made twice. Other records may be simulated from
        # several starts, by which the journal does not tell them apart.
        simulating = (
            self._journalled(variants=BAND if draws else FORECAST)
            if self.task.long
            else WatchedSimulations(self.plugins, self.listener.counted, variants=NOT_FITTED)
        )
        try:
            found = predict(self.task, best.candidate, self.task.held_out, simulating, draws, misfits(fitted))
        except KeyboardInterrupt:
            self.cut_short = True
            self._note(NO_BAND if before else NOT_PREDICTED)
            return before
        event = {"predictions": [encode_prediction(one) for one in found], "draws": len(draws)}
        self.journal.append(HELD_OUT, base=best.index, **event)
        self._predictions[best.index] = event
        return found

    def _journalled(self, **purposes: str) -> JournalledSimulations:
        """Simulations that are written down and not made again; those that are made are counted aloud."""
        return JournalledSimulations(
            WatchedSimulations(self.plugins, self.listener.counted, **purposes), self.journal, self._simulated
        )

    def _note(self, text: str) -> None:
        self.journal.append("note", text=text)
        self.listener.noted(text)


def read_record_errors(event: Mapping[str, Any]) -> tuple[RecordErrors, ...]:
    """The errors record by record in the journal's event of a score."""
    return tuple(RecordErrors.from_json(content) for content in event.get("records", ()))
