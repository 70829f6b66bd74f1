"""What plugins answer during a run is checked, and who answered wrongly is named."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bsa.backends.rules.backend import RulesBackend
from bsa.core.contracts.registry import Registry
from bsa.core.errors import BsaError
from bsa.core.feedback import Feedback
from bsa.core.hooks import Entry, ProposeContext, Recollection, RunContext, hookimpl
from bsa.core.messages import BackendFailure, BudgetSpent
from bsa.core.proposal import Proposal
from bsa.core.run.journal import read_events
from bsa.core.run.run_plugins import RunPlugins
from bsa.core.scaffold import Scaffold
from bsa.core.simulation import ExperimentRun, Outcome, SimulationFailure
from bsa.core.task_reduction import TaskReduction
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.core.trial import Trial
from bsa_toy_cell import CAPACITY, record, toy_scaffold, toy_task

TASK = toy_task()
SPACE = TASK.space
GOOD = Outcome((ExperimentRun(record(SPACE.initial)),))
KINDS = {
    "simulator": ("bsa_simulators", "simulate"),
    "feedback": ("bsa_feedback_builders", "build_feedback"),
    "memory": ("bsa_memories", "recall"),
    "proposer": ("bsa_proposers", "propose"),
    "warm-up": ("bsa_warm_ups", "warm_up"),
}

Install = Callable[..., Path]


class Plain:
    """Does what every hook promises, in the shortest way."""

    @hookimpl
    def simulate(self, candidates: Any) -> Iterator[tuple[int, Outcome]]:
        yield from ((place, GOOD) for place in reversed(range(len(candidates))))


class PlainFeedback:
    @hookimpl
    def build_feedback(self, index: int) -> Feedback:
        return Feedback({"index": index})


class PlainMemory:
    @hookimpl
    def recall(self, budget: int = 7) -> Recollection:
        return Recollection("Notes", {"budget": budget})


class PlainProposer:
    @hookimpl
    def propose(self, context: ProposeContext) -> Proposal:
        return Proposal((dict(context.best.candidate),))


class PlainWarmUp:
    @hookimpl
    def warm_up(self) -> None:
        return None


PLAIN: dict[str, type] = {
    "simulator": Plain,
    "feedback": PlainFeedback,
    "memory": PlainMemory,
    "proposer": PlainProposer,
    "warm-up": PlainWarmUp,
}


def plugins(folder: Path = Path(), notes: list[str] | None = None, **changed: Any) -> RunPlugins:
    """Plain plugins, some of them exchanged for a hook's function or an object."""
    registry = Registry()
    for kind, (catalogue_hook, hook) in KINDS.items():
        made = changed.get(kind.replace("-", "_"), PLAIN[kind]())
        if callable(made) and not hasattr(made, hook):
            made = type("Faulty", (), {hook: hookimpl(made)})()

        def entries(kind: str = kind, made: object = made) -> list[Entry]:
            return [Entry("zz-" + kind, lambda options, context: made, "Of a stranger.", api=1)]

        registry.register(SimpleNamespace(**{catalogue_hook: hookimpl(entries)}), kind, "zz-fault 0.1")
    scaffold = Scaffold.model_validate(
        {
            "name": "strange",
            "simulator": "zz-simulator",
            "feedback": "zz-feedback",
            "memories": ["zz-memory"],
            "warm_up": "zz-warm-up",
            "proposer": "zz-proposer",
        }
    )
    return RunPlugins(
        scaffold,
        RunContext(TASK, 1, folder),
        registry.collect(),
        (notes if notes is not None else []).append,
    )


def trial(**changes: Any) -> Trial:
    made = Trial(0, "initial", 0, SPACE.initial, None, None, None, Feedback(), (None,), 0.0)
    return replace(made, **changes)


def context() -> ProposeContext:
    return ProposeContext(TASK, 1, (trial(),), trial(), 1, 5)


def simulated(found: RunPlugins, count: int = 2) -> list[tuple[int, Outcome]]:
    return list(found.simulate([SPACE.initial] * count, False))


def test_plain_plugins_pass() -> None:
    found = plugins()
    assert [place for place, _ in simulated(found)] == [1, 0]
    assert found.build_feedback(GOOD, None, 3).content == {"index": 3}
    # A default does not keep an argument from being passed.
    assert found.recall(500)[0].content == {"budget": 500}
    assert found.propose(context()).candidates == (SPACE.initial,)
    assert found.warm_up(context()) is None
    assert found.reduce_task(TaskReduction(0.5)) is None
    assert found.simulate_variant([], ()) is None
    assert found.simulate_finer({}) is None
    assert found.weighs_priors() is False
    assert dict(found.next_protocols()) == dict(found.export(SPACE.initial)) == {}
    found.remember(trial(), None)
    found.close()


FAILED = ExperimentRun(None, SimulationFailure("gave up"))
CUT = ExperimentRun(None, SimulationFailure("gave up", unfinished=1))  # type: ignore[arg-type]
AT_LIMIT = replace(GOOD.runs[0], at_limit=(3.0, 7.0))
LASTING = replace(GOOD.runs[0], at_limit=((3.0, float("inf")),))
UNCUT = Trajectory(*([0.0, 1.0],) * 3)  # type: ignore[arg-type]

SIMULATORS: dict[str, tuple[Any, str]] = {
    "None": (None, "simulate returned None, not pairs of place and Outcome"),
    "a number": (7, "simulate returned 7, not pairs"),
    "outcomes alone": ([GOOD, GOOD], "not a pair of place and Outcome"),
    "too few": ([(0, GOOD)], "simulate gave no outcome for 1 of 2 candidates, the first at place 1"),
    "one twice": ([(0, GOOD), (0, GOOD)], "simulate answered candidate 0 twice"),
    "one too many": ([(0, GOOD), (1, GOOD), (2, GOOD)], "simulate answered candidate 2 of 2"),
    "a place that is none": ([("0", GOOD)], "simulate answered candidate '0' of 2"),
    "no outcome": ([(0, None)], "simulate yielded None, not an Outcome"),
    "a trajectory": ([(0, record(SPACE.initial))], "not an Outcome"),
    "no run": ([(0, Outcome(()))], "an Outcome with 0 runs for 1 experiment"),
    "two runs": ([(0, Outcome((FAILED, FAILED)))], "an Outcome with 2 runs for 1 experiment"),
    "an empty run": ([(0, Outcome((ExperimentRun(None),)))], "a run with neither a trajectory nor a failure"),
    "no trajectory": ([(0, Outcome((ExperimentRun("curve"),)))], "a run whose trajectory is 'curve'"),  # type: ignore[arg-type]
    "no steps": ([(0, Outcome((ExperimentRun(UNCUT),)))], "a trajectory without steps"),
    "no voltage": ([(0, Outcome((ExperimentRun(Trajectory(UNCUT.time, UNCUT.current)),)))], 'without "voltage"'),
    "no samples": ([(0, Outcome((ExperimentRun(UNCUT.slice(0, 0)),)))], "an empty trajectory"),
    "unfinished": ([(0, Outcome((CUT,)))], "SimulationFailure.unfinished = 1 (int), not a bool"),
    "no periods": ([(0, Outcome((AT_LIMIT,)))], "ExperimentRun.at_limit = (3.0, 7.0), not a tuple of pairs"),
    "no end": ([(0, Outcome((LASTING,)))], "a time of ExperimentRun.at_limit = inf, which is not a finite number"),
    "no seconds": ([(0, replace(GOOD, seconds=float("nan")))], "Outcome.seconds = nan, which is not a finite number"),
}


@pytest.mark.parametrize("name", SIMULATORS)
def test_a_simulator_that_breaks_its_word_is_named(name: str) -> None:
    answer, words = SIMULATORS[name]
    with pytest.raises(BsaError) as raised:
        simulated(plugins(simulator=lambda self, candidates, exact: answer))
    assert str(raised.value).startswith("simulator zz-simulator of zz-fault 0.1: simulate ")
    assert words in raised.value.message


def driven(end: int, failure: SimulationFailure | None = None) -> RunPlugins:
    """Of a simulator that answers a record under its measured current with some of its first samples."""
    whole = GOOD.runs[0].trajectory
    assert whole is not None
    measured = replace(TASK.experiments[0], protocol=None, target=whole)
    run = ExperimentRun(whole.picked(slice(0, end), (Step(StepKind.DRIVE, 0, end),)), failure)
    made = plugins(simulator=lambda self, candidates, exact: [(0, Outcome((run,)))])
    made._context = replace(made._context, task=replace(TASK, experiments=(measured,)))
    return made


def test_a_simulation_that_ends_before_its_firstsays_why() -> None:
    whole = GOOD.runs[0].trajectory
    assert whole is not None
    with pytest.raises(BsaError) as raised:
        simulated(driven(2), 1)
    assert raised.value.message == (
        "simulator zz-simulator of zz-fault 0.1: simulate yielded 2 samples that end after 60 s, without a failure; "
        f'the record "toy record" has 262 in {whole.duration:,.6g} s.'
    )
    assert "SimulationFailure" in raised.value.hint
    assert simulated(driven(2, SimulationFailure("gave up")), 1)
    assert simulated(driven(262), 1)
    assert simulated(driven(261), 1)  # how long the last sample lasts is open
    with pytest.raises(BsaError, match="yielded 260 samples"):
        simulated(driven(260), 1)


@pytest.mark.parametrize(
    ("voltage", "words"),
    [([4.0, float("nan")], "voltage is nan at sample 1."), ([4.0], "voltage has shape (1,), but time has shape (2,).")],
)
def test_samples_that_are_none_are_those_of_the_simulator(voltage: list[float], words: str) -> None:
    def simulate(self: Any, candidates: Any) -> Iterator[tuple[int, Outcome]]:
        time = np.array([0.0, 1.0])
        yield 0, Outcome((ExperimentRun(Trajectory(time, np.zeros(2), np.array(voltage))),))

    with pytest.raises(BsaError) as raised:
        simulated(plugins(simulator=simulate), 1)
    assert raised.value.message.startswith("simulator zz-simulator of zz-fault 0.1: simulate gave samples ")
    assert raised.value.message.endswith(words)
    assert "repair the sample" not in raised.value.hint


def test_outcomes_before_an_exception_count() -> None:
    def simulate(self: Any, candidates: Any) -> Iterator[tuple[int, Outcome]]:
        yield 0, GOOD
        raise RuntimeError("boom")

    seen: list[int] = []
    found = plugins(simulator=simulate).simulate([SPACE.initial] * 2, False)
    with pytest.raises(
        BsaError, match=r"simulator zz-simulator of zz-fault 0\.1: boom in simulate\. Hint: RuntimeError at"
    ):
        seen.extend(place for place, _ in found)
    assert seen == [0]


def test_a_simulator_cannot_change_the_candidates() -> None:
    def simulate(self: Any, candidates: Any) -> Iterator[tuple[int, Outcome]]:
        candidates[0].clear()
        yield 0, GOOD

    candidate = dict(SPACE.initial)
    list(plugins(simulator=simulate).simulate([candidate], False))
    assert candidate == SPACE.initial


OFF = {**SPACE.initial, CAPACITY: float("inf")}

PROPOSALS: dict[str, tuple[Any, str]] = {
    "None": (None, "propose returned None, not a Proposal"),
    "a dict": ({}, "not a Proposal"),
    "one candidate": (Proposal(SPACE.initial), "Proposal.candidates = "),  # type: ignore[arg-type]
    "no candidate": (Proposal((7,)), "gave a candidate = 7, not a mapping"),  # type: ignore[arg-type]
    "a stranger's parameter": (
        Proposal(({**SPACE.initial, "Capacty [A.h]": 1.0},)),
        '"Capacty [A.h]", which is not searched',
    ),
    "a parameter too few": (Proposal(({CAPACITY: 1.0},)), 'a candidate without "Series resistance [Ohm]"'),
    "not finite": (Proposal((OFF,)), 'candidate["Capacity [A.h]"] = inf, which is not a finite number'),
    "a text": (Proposal(({**OFF, CAPACITY: "1.0"},)), "which is not a finite number"),  # type: ignore[dict-item]
    "no hypothesis": (Proposal((), None), "Proposal.hypothesis = None, not a str"),  # type: ignore[arg-type]
    "details": (Proposal((), details={"f": object()}), "Proposal.details that is no JSON"),
    "finished": (Proposal((), finished="yes"), "Proposal.finished = 'yes' (str), not a bool"),  # type: ignore[arg-type]
    "by simulations": (Proposal((), by_simulations=1), "Proposal.by_simulations = 1 (int), not a bool"),  # type: ignore[arg-type]
    "no reason": (Proposal(()), "a Proposal without candidates and without a reason"),
    "reductions": (Proposal((SPACE.initial,), reductions=(None, None)), "Proposal.reductions"),
}


@pytest.mark.parametrize("name", PROPOSALS)
def test_a_proposer_that_breaks_its_word_is_named(name: str) -> None:
    answer, words = PROPOSALS[name]
    with pytest.raises(BsaError) as raised:
        plugins(proposer=lambda self, context: answer).propose(context())
    assert str(raised.value).startswith("proposer zz-proposer of zz-fault 0.1: propose ")
    assert words in raised.value.message
    if answer is not None:
        with pytest.raises(BsaError, match=r"warm-up zz-warm-up of zz-fault 0\.1: warm_up "):
            plugins(warm_up=lambda self, context: answer).warm_up(context())


def test_the_nearest_parameter_is_named() -> None:
    answer = Proposal(({"Capacty [A.h]": 1.0},))
    with pytest.raises(BsaError, match=r'did you mean "Capacity \[A\.h\]"\?'):
        plugins(proposer=lambda self, context: answer).propose(context())


def test_numbers_of_numpy_become_plain_ones() -> None:
    import numpy as np

    candidate = {name: np.float32(value) for name, value in reversed(SPACE.initial.items())}
    (found,) = plugins(proposer=lambda self, context: Proposal([candidate])).propose(context()).candidates
    assert list(found) == list(SPACE.names)
    assert {type(value) for value in found.values()} == {float}


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (None, "build_feedback returned None, not a Feedback"),
        ({"error": 1.0}, "not a Feedback"),
        (Feedback({"f": {1, 2}}), "Feedback.content that is no JSON"),
        (Feedback({"f": float("nan")}), "Feedback.content that is no JSON"),
        (Feedback("text"), "Feedback.content = 'text', not a mapping"),  # type: ignore[arg-type]
        (Feedback({}, (Path("/etc/hostname"),)), "gave the image"),
        (Feedback({}, ("overlay.png",)), "gave the image 'overlay.png'"),  # type: ignore[arg-type]
    ],
)
def test_a_feedback_builder_that_breaks_its_word_is_named(tmp_path: Path, answer: Any, words: str) -> None:
    with pytest.raises(BsaError) as raised:
        plugins(tmp_path, feedback=lambda self, outcome: answer).build_feedback(GOOD, None, 0)
    assert str(raised.value).startswith("feedback zz-feedback of zz-fault 0.1: build_feedback ")
    assert words in raised.value.message


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        ("text", "recall returned 'text' (str), not a Recollection"),
        (Recollection(7, {}), "Recollection.title = 7 (int), not a str"),  # type: ignore[arg-type]
        (Recollection("Notes", ["one"]), "Recollection.content = ['one'], not a mapping"),  # type: ignore[arg-type]
        (Recollection("Notes", {(1, 2): 3}), "Recollection.content that is no JSON"),
        (Recollection("Notes", {}, "high"), "Recollection.priority = 'high' (str), not an int"),  # type: ignore[arg-type]
    ],
)
def test_a_memory_that_breaks_its_word_is_named(answer: Any, words: str) -> None:
    with pytest.raises(BsaError) as raised:
        plugins(memory=lambda self, budget: answer).recall(500)
    assert str(raised.value).startswith("memory zz-memory of zz-fault 0.1: recall ")
    assert words in raised.value.message


def test_a_section_longer_than_its_budget_is_left_out_and_noted_once() -> None:
    notes: list[str] = []
    found = plugins(notes=notes, memory=lambda self, budget: Recollection("Notes", {"text": "x" * budget}))
    assert found.recall(500) == found.recall(500) == []
    (note,) = notes
    assert note.startswith("memory zz-memory of zz-fault 0.1: recall gave 512 characters for a budget of 500")


class Remembering(PlainMemory):
    def __init__(self, error: BaseException) -> None:
        self.error = error

    @hookimpl
    def remember(self, trial: Trial) -> None:
        raise self.error


@pytest.mark.parametrize("error", [RuntimeError("boom"), SystemExit("boom"), BaseException("boom\nand more")])
def test_whatever_a_plugin_raises_is_one_line_that_names_it(error: BaseException) -> None:
    with pytest.raises(BsaError) as raised:
        plugins(memory=Remembering(error)).remember(trial(), None)
    kind = "SystemExit: " * isinstance(error, SystemExit)
    assert raised.value.message == f"memory zz-memory of zz-fault 0.1: {kind}boom in remember."
    assert type(error).__name__ in raised.value.hint
    assert "test_run_plugins.py, line" in raised.value.hint


@pytest.mark.parametrize("error", [KeyboardInterrupt(), BudgetSpent("10 tokens"), BsaError("no key.", "set one.")])
def test_what_is_meant_passes(error: BaseException) -> None:
    with pytest.raises(type(error)) as raised:
        plugins(memory=Remembering(error)).remember(trial(), None)
    assert raised.value is error


def test_a_lost_call_that_a_proposer_lets_pass_is_a_lost_round() -> None:
    def propose(self: Any, context: ProposeContext) -> Proposal:
        raise BackendFailure("gone")

    assert plugins(proposer=propose).propose(context()).lost == "no reply: gone"
    assert plugins(warm_up=propose).warm_up(context()).lost == "no reply: gone"  # type: ignore[union-attr]


class Exporting(Plain):
    def __init__(self, files: object) -> None:
        self.files = files

    @hookimpl
    def export(self) -> object:
        return self.files


@pytest.mark.parametrize("name", ["../x.py", "/etc/x", "a/b", "journal.jsonl", "result.json", ".hidden", "", "a\nb"])
def test_an_export_stays_in_its_folder_and_off_the_runs_files(name: str) -> None:
    with pytest.raises(BsaError, match=r"simulator zz-simulator of zz-fault 0\.1: export gave the file name"):
        plugins(simulator=Exporting({name: "x"})).export(SPACE.initial)
    assert plugins(simulator=Exporting({"cell.py": "x"})).export(SPACE.initial) == {"cell.py": "x"}


class Misspelt(PlainMemory):
    @hookimpl
    def rememberr(self, trial: Trial) -> None:
        """Never called."""


class Unmarked(PlainMemory):
    def remember(self, trial: Trial) -> None:
        """Never called."""


class Forgetful:
    """No memory at all."""


class Greedy(PlainMemory):
    @hookimpl
    def simulate(self, candidates: Any) -> list[Any]:
        return []


class Asking(PlainMemory):
    @hookimpl
    def remember(self, trial: Trial, wishes: int) -> None:
        """Cannot be called."""


@pytest.mark.parametrize(
    ("memory", "words"),
    [
        (Misspelt(), r'"rememberr" is no hook: did you mean "remember"\?'),
        (Unmarked(), '"remember" is named as a hook and not marked: put @hookimpl above it'),
        (Forgetful(), 'it does not implement "recall", which is what a memory is for'),
        (Asking(), "'wishes'"),
        (None, "its factory returned None"),
    ],
)
def test_a_plugin_whose_methods_would_not_be_called_is_refused(memory: object, words: str) -> None:
    with pytest.raises(BsaError, match=words) as raised:
        plugins(memory=memory)
    assert raised.value.message.startswith("memory zz-memory of zz-fault 0.1: ")


def test_two_plugins_cannot_answer_one_hook() -> None:
    with pytest.raises(BsaError, match='2 plugins that implement "simulate"'):
        plugins(memory=Greedy())


def test_plugins_go_over_to_another_task() -> None:
    class Closing(Plain):
        @hookimpl
        def close(self) -> None:
            closed.append(True)

    closed: list[bool] = []
    made = plugins(simulator=Closing())
    assert [outcome for _, outcome in made.simulate([SPACE.initial], False)] == [GOOD]
    (first,) = TASK.experiments
    made.go_over_to(replace(TASK, experiments=(first, replace(first, name="another"))))
    assert closed == [True]
    with pytest.raises(BsaError, match="zz-simulator"):  # An outcome of one record is none of two.
        list(made.simulate([SPACE.initial], False))


def test_what_goes_wrong_at_the_end_is_noted_and_the_others_are_closed() -> None:
    class Closing(Plain):
        @hookimpl
        def close(self) -> None:
            closed.append("simulator")
            raise RuntimeError("boom")

    class ClosingMemory(PlainMemory):
        @hookimpl
        def close(self) -> None:
            closed.append("memory")

    closed: list[str] = []
    notes: list[str] = []
    plugins(notes=notes, simulator=Closing(), memory=ClosingMemory()).close()
    assert closed == ["simulator", "memory"]
    assert notes[0].startswith("simulator zz-simulator of zz-fault 0.1: boom in close")


FAULTY = """
from pathlib import Path
from bsa.core.hooks import Entry, Recollection, hookimpl

class Memory:
    def __init__(self, options, context):
        self.folder = context.folder

    @hookimpl
    def recall(self, budget):
        return Recollection("Notes", {})

    @hookimpl
    def remember(self, trial):
        if trial.index == 5 and self.folder.with_suffix(".fault").exists():
            raise RuntimeError("boom")

@hookimpl
def bsa_memories():
    yield Entry("zz-mem", Memory, "Raises at the sixth trial.", api=1)
"""


def test_a_run_that_a_plugin_ends_keeps_its_journal_and_is_resumed(
    stranger: Install, run_toy: Callable[..., Any], tmp_path: Path
) -> None:
    stranger(FAULTY)
    scaffold = toy_scaffold(memories=["history", "zz-mem"])
    whole = run_toy(tmp_path / "whole", scaffold=scaffold, simulations=10, backend=RulesBackend())
    folder = tmp_path / "cut"
    (tmp_path / "cut.fault").touch()
    with pytest.raises(BsaError, match=r"^memory zz-mem of zz-fault 0\.1: boom in remember\. Hint: RuntimeError at"):
        run_toy(folder, scaffold=scaffold, simulations=10)
    kept = {event["index"] for event in read_events(folder) if event["event"] == "trial"}
    assert kept >= {0, 1, 2, 3, 4, 5}
    (tmp_path / "cut.fault").unlink()
    resumed = run_toy(folder, scaffold=scaffold, simulations=10)
    assert [dict(t.candidate) for t in resumed.trials] == [dict(t.candidate) for t in whole.trials]
