"""The run loop: the paper's Algorithm 1, made resumable.

A run resumes by doing everything again, except that finished simulations and replies come out of the
journal. Proposers and memories so rebuild their state by being asked the same questions.
"""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import takewhile
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ..comparison.record_errors import RecordErrors
from ..comparison.residuals import partial_residuals, residuals
from ..encoding import decode_trial, encode_proposal, encode_trial
from ..errors import BsaError
from ..feedback import Feedback
from ..hooks import ProposeContext
from ..inference.post_fit_analysis import PostFitAnalysis
from ..inference.prediction import Prediction
from ..messages import Outage, RunStopped, Usage
from ..metrics import Metrics, evaluate
from ..offered_effects import as_found, of_the_found
from ..parameters import Candidate
from ..proposal import LACKING, Proposal, unusable_replies
from ..simulation import ExperimentRun, Outcome, SimulationFailure
from ..task import Task
from ..task_reduction import TaskReduction
from ..thinning import SAMPLES_OF_DRIVES
from ..trajectory import FloatArray
from ..trial import Phase, Trial, lowest, repeated_by
from .after_search import AfterSearch, Score
from .answer import answer
from .budget import SimulationBudget
from .interrupts import interrupts_wait
from .journal import Journal, spent_s
from .listener import SILENT, Listener
from .low_fidelity import LowFidelitySimulations
from .recording import Recorder
from .run_config import RunConfig
from .run_plugins import RunPlugins

Status = Literal["converged", "finished", "rounds-spent", "simulations-spent", "budget-spent", "outage", "interrupted"]

_IMPROVEMENT = 1e-3
_CURVE_SAMPLES_PER_STEP, _SWING_SAMPLES_PER_STEP = 60, 600
"""Samples of a step that a trial's curves keep, and those of one in which a signal oscillates."""

_PHASE_CODE: dict[Phase, int] = {"initial": 0, "warm-up": 1, "search": 2}


@dataclass(frozen=True, eq=False)
class RunResult:
    """How a run ended."""

    status: Status  # Why it ended.
    task: Task  # What was matched, with those alone of the effects that it was offered which the answer has.
    best: Trial  # The run's answer (`answer`), to which parameters and intervals belong.
    lowest: Trial  # The trial with the lowest objective, by which benchmarks score; often the same.
    # initial_metrics, best_metrics, lowest_metrics: Scored with the simulator's reference accuracy (PyBaMM's standard
    # mesh).
    initial_metrics: Metrics | None
    best_metrics: Metrics | None
    lowest_metrics: Metrics | None
    trials: tuple[Trial, ...]  # Everything that was tried.
    usage: Usage  # Tokens and cost.
    # llm_calls, lost_calls: Calls of the backend, lost ones included; those that gave no reply.
    llm_calls: int
    lost_calls: int
    # unusable_replies, lost_rounds: Replies that could not be used, and rounds without a candidate for that or for want
    # of a reply.
    unusable_replies: int
    lost_rounds: int
    # wall_s, simulator_s: Time from start to end, of each time the run was taken up, and of all simulations of the
    # search, those by a low-fidelity model included, in seconds.
    wall_s: float
    simulator_s: float
    # low_fidelity_simulations, low_fidelity_s: Simulations by a low-fidelity model, between those of the search and not
    # counted among them; and the time of them all, in seconds.
    low_fidelity_simulations: int = 0
    low_fidelity_s: float = 0.0
    analysis: PostFitAnalysis | None = None  # What the records fix, where that was asked for and something simulated.
    # Why the language model was not asked any more, where that stopped the run before its end; of a finished search
    # what it left out for lack of simulations.
    reason: str = ""
    # Of the best candidate, record by record, with reference accuracy; empty where it was not scored so.
    records: tuple[RecordErrors, ...] = ()
    held_out: tuple[Prediction, ...] = ()  # Of the task's records that were not fitted.
    # How a stopped run goes on, in sentences, where --resume alone would stop at the same place.
    advice: str = ""
    cut_short: bool = False  # Whether what follows the finished search was interrupted; a resumed run goes on with it.


@dataclass(eq=False)
class Run:
    """One run of one task."""

    task: Task
    config: RunConfig
    plugins: RunPlugins
    recorder: Recorder  # Keeps the books of the language model.
    journal: Journal
    folder: Path
    earlier: Sequence[Mapping[str, Any]] = ()  # Events of the interrupted run, if any.
    listener: Listener = SILENT
    # Whether it looks, after the search, at what the records fix, which costs simulations that are not the search's.
    # Without it only an analysis that the journal holds is told.
    analysing: bool = False
    # Is given the result as soon as the rest of a life is forecast, before that analysis.
    forecast: Callable[[RunResult], None] = lambda result: None

    def __post_init__(self) -> None:
        self._earlier_trials = {event["index"]: event for event in self.earlier if event["event"] == "trial"}
        self._budget = SimulationBudget(self.config, self.earlier)
        self._proposals = 0
        self._earlier_proposals = sum(event["event"] == "proposal" for event in self.earlier)
        self._earlier_s = spent_s(self.earlier)
        self._low_fidelity = LowFidelitySimulations(self.task, self.plugins, self.journal, self.earlier, self.listener)
        self._trials: list[Trial] = []
        self._lacking = self._advice = ""
        self._repetition_told = False
        self._unusable_replies = self._lost_rounds = 0

    @property
    def lowest(self) -> Trial:
        """The trial with the lowest objective so far; the initial one if none succeeded."""
        return lowest(self._trials)

    @property
    def _simulations_left(self) -> int:
        return self._budget.after(self._proposals) - len(self._trials)

    def execute(self) -> RunResult:
        """Run to the end, or until interrupted; the journal is complete either way."""
        started = time.perf_counter()
        status: Status
        reason = ""
        try:
            self._simulate([self.task.space.initial], "initial", 0, None)
            self._warm_up()
            status = self._search()
            reason = self._lacking
        except KeyboardInterrupt:
            status = "interrupted"
        except RunStopped as stopped:
            reason, self._advice = str(stopped), stopped.advice
            status = "outage" if isinstance(stopped, Outage) else "budget-spent"
            self.journal.append("note", text=f"Stopped: {reason}.")
        if not self._trials:
            raise KeyboardInterrupt
        return self._finish(status, reason, started)

    def _warm_up(self) -> None:
        limit = min(self.config.warm_up, self._simulations_left)
        if limit <= 0:
            return
        proposal = self.plugins.warm_up(self._context("warm-up", 1, limit))
        if proposal is not None:
            self._take(proposal, "warm-up", 1)

    def _search(self) -> Status:
        number = counted = stalled = 0
        reference = self.lowest.objective
        while counted < self.config.rounds:
            if self._simulations_left <= 0:
                return "simulations-spent"
            if self.lowest.objective <= self.config.stop_below:
                return "converged"
            number += 1
            replies, lost = self.recorder.replies, self.recorder.lost
            proposal = self.plugins.propose(self._context("search", number, self._simulations_left))
            unheard = self.recorder.lost > lost and self.recorder.replies == replies
            self._take(proposal, "search", number)
            if proposal.finished and self._budget.grows_after(self._proposals):
                # It may have ended for what it was allowed: it is asked again, with more.
                stalled, reference = 0, self.lowest.objective
                continue
            if proposal.finished:
                self._lacking = str(proposal.details.get(LACKING, ""))
                return "finished"
            # Without candidates no simulation is spent, and nothing else would end the search.
            uncounted = proposal.by_simulations and bool(proposal.candidates)
            counted += not uncounted
            if uncounted or proposal.advancing or self.lowest.objective < reference * (1.0 - _IMPROVEMENT):
                stalled, reference = 0, self.lowest.objective
            elif not (unheard and proposal.lost):
                # A round in which the model had no say tells nothing of whether the search still improves.
                stalled += 1
            if stalled >= self.config.patience:
                return "converged"
        return "rounds-spent"

    def _context(self, phase: Phase, number: int, simulations_left: int) -> ProposeContext:
        seed = np.random.SeedSequence([self.config.seed, _PHASE_CODE[phase], number]).generate_state(1)[0]
        return ProposeContext(
            task=self.task,
            round=number,
            trials=tuple(self._trials),
            best=self.lowest,
            seed=int(seed),
            simulations_left=simulations_left,
            recall=self.plugins.recall,
            equilibrium=self.plugins.equilibrium,
            low_fidelity=self._low_fidelity if self._low_fidelity.exists else None,
        )

    def _take(self, proposal: Proposal, phase: Phase, number: int) -> None:
        self._proposals += 1
        self._unusable_replies += unusable_replies(proposal.details)
        self._lost_rounds += bool(proposal.lost)
        if self._earlier_proposals > 0:
            self._earlier_proposals -= 1
        else:
            self.journal.append("proposal", phase=phase, round=number, **encode_proposal(proposal))
        self.listener.proposed(proposal, phase, number)
        # A round that the end of the budget had cut short is completed once the run is allowed more.
        limit = self._simulations_left
        if phase == "warm-up":
            limit = min(limit, self.config.warm_up)
        candidates = [self.task.space.project(candidate) for candidate in proposal.candidates[: max(limit, 0)]]
        self._simulate(candidates, phase, number, proposal)

    def _simulate(self, candidates: Sequence[Candidate], phase: Phase, number: int, proposal: Proposal | None) -> None:
        reductions = (proposal.reductions if proposal is not None else ()) or (None,) * len(candidates)
        first = len(self._trials)
        done: dict[int, Trial] = {}
        todo: list[int] = []
        for place, candidate in enumerate(candidates):
            earlier = self._earlier_trials.pop(first + place, None)
            if earlier is None:
                todo.append(place)
                continue
            reduction = reductions[place]
            if dict(earlier["candidate"]) != dict(candidate) or earlier.get("reduction") != (
                reduction and asdict(reduction)
            ):
                raise BsaError(
                    f"the journal does not fit: simulation {first + place} of {self.journal.path} "
                    "was made with other parameters than this version proposes.",
                    "resume with the version and the settings that began the run, or start a new one.",
                )
            done[place] = decode_trial(earlier, self.folder)

        try:
            for reduction in dict.fromkeys(reductions[place] for place in todo):
                places = [place for place in todo if reductions[place] == reduction]
                for position, outcome in self._outcomes([candidates[place] for place in places], reduction):
                    place = places[position]
                    trial = self._trial(first + place, phase, number, candidates[place], outcome, reduction)
                    with interrupts_wait():
                        self.journal.append("trial", **encode_trial(trial, self.folder))
                        done[place] = trial
        except BaseException:
            # A stopped run has a result and a report of each trial that is in its journal, up to the first gap.
            self._trials += [done[place] for place in takewhile(done.__contains__, range(len(candidates)))]
            raise
        for place in range(len(candidates)):
            self._trials.append(done[place])
            if place in todo:
                self._tell_repetition(done[place])
            self.plugins.remember(done[place], proposal)
            self.listener.tried(done[place], self.lowest, self.recorder.usage)

    def _tell_repetition(self, trial: Trial) -> None:
        """Say once that simulations are spent on values that were simulated before; the report says each time."""
        if self._repetition_told:
            return
        earlier = repeated_by(trial, self._trials)
        if earlier is not None:
            self._repetition_told = True
            self.listener.noted(
                f"Simulation {trial.index} has the values of simulation {earlier.index} again; it counts all the same. "
                "Further repetitions are told in the report, round by round."
            )

    def _outcomes(
        self, candidates: Sequence[Candidate], reduction: TaskReduction | None
    ) -> Iterable[tuple[int, Outcome]]:
        if reduction is None:
            return self.plugins.simulate(candidates, False)
        experiments = self.plugins.reduce_task(reduction)
        outcomes = None if experiments is None else self.plugins.simulate_variant(candidates, experiments)
        if outcomes is None:
            refused = ExperimentRun(None, SimulationFailure("this simulator cannot reduce a task"))
            return enumerate([Outcome((refused,) * len(self.task.experiments))] * len(candidates))
        return outcomes

    def _trial(
        self,
        index: int,
        phase: Phase,
        number: int,
        candidate: Candidate,
        outcome: Outcome,
        reduction: TaskReduction | None,
    ) -> Trial:
        metrics: Metrics | None = None
        found: FloatArray | None = None
        failure = outcome.failure
        if reduction is None:
            metrics, found = evaluate(self.task, outcome), residuals(self.task, outcome)
            feedback = self.plugins.build_feedback(outcome, metrics, index)
        else:
            # What a builder says compares with the record of the task as it is.
            event = "simulation_success" if failure is None else f"simulation_failed: {failure.cause}"
            feedback = Feedback({"reduced": reduction.words, "events": [event]})
        # There is no record at lower currents.
        compared = failure is not None if reduction is None else reduction.rate == 1.0
        swings = any(signal.oscillates for signal in self.task.observed)
        samples = _SWING_SAMPLES_PER_STEP if swings else _CURVE_SAMPLES_PER_STEP
        curves = tuple(
            None if run.trajectory is None else run.trajectory.thinned(samples, SAMPLES_OF_DRIVES)
            for run in outcome.runs
        )
        return Trial(
            index=index,
            phase=phase,
            round=number,
            candidate=candidate,
            metrics=metrics,
            failure=failure,
            residuals=found,
            feedback=feedback,
            curves=curves,
            seconds=outcome.seconds,
            reduction=reduction,
            partial=partial_residuals(self.task, outcome) if compared else None,
            limits=outcome.limits,
        )

    def _finish(self, status: Status, reason: str, started: float) -> RunResult:
        found = as_found(self.task, answer(self.task, self._trials))
        trials = of_the_found(self.task, found, self._trials)
        initial, best, scored_best = trials[0], answer(found, trials), lowest(trials)
        if found.cell.effects != self.task.cell.effects:
            self.plugins.go_over_to(found)
        # Of a run that is to go on, nobody wants to wait for the last word.
        last_word = status not in ("interrupted", "outage")
        after = AfterSearch(found, self.plugins, self.journal, self.earlier, self.listener)
        scores = after.score([initial, best, scored_best]) if last_word else {}
        fit = scores.get(best.index, Score(best.metrics))
        # A single simulation is no fit, and there is nothing to judge.
        analysing = last_word and self.analysing and len(self._trials) > 1

        def result(analysis: PostFitAnalysis | None, held_out: tuple[Prediction, ...], took_s: float) -> RunResult:
            return RunResult(
                status=status,
                task=found,
                best=best,
                lowest=scored_best,
                initial_metrics=scores.get(initial.index, Score(initial.metrics)).metrics,
                best_metrics=fit.metrics,
                lowest_metrics=scores.get(scored_best.index, Score(scored_best.metrics)).metrics,
                trials=tuple(self._trials),
                usage=self.recorder.usage,
                llm_calls=self.recorder.calls,
                lost_calls=self.recorder.lost,
                unusable_replies=self._unusable_replies,
                lost_rounds=self._lost_rounds,
                wall_s=self._earlier_s + took_s,
                simulator_s=sum(trial.seconds for trial in self._trials) + self._low_fidelity.seconds,
                low_fidelity_simulations=self._low_fidelity.simulations,
                low_fidelity_s=self._low_fidelity.seconds,
                analysis=analysis,
                reason=reason,
                records=fit.records,
                held_out=held_out,
                advice=self._advice,
                cut_short=after.cut_short,
            )

        soon = after.forecast(best) if analysing else ()
        if soon:
            self.forecast(result(None, soon, time.perf_counter() - started))
        # What was found out before is not forgotten where nothing further is to be.
        analysis = after.analyse(trials, best, self.config.simulations) if analysing else after.known_analysis(best)
        held_out = after.predict(best, analysis, fit.records) if last_word else ()
        took_s = time.perf_counter() - started
        self.journal.append("end", status=status, best=best.index, wall_s=took_s)
        return result(analysis, held_out, took_s)
