"""An agent that finds nothing better leaves the fit as it is; one that does is followed at once."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bsa.backends.bad_advice import AdversarialAdvice, RandomAdvice
from bsa.backends.rules.backend import RulesBackend
from bsa.core.errors import BsaError
from bsa.core.feedback import Feedback
from bsa.core.messages import Backend, JsonSchema, Message, PromptRefused, Reply
from bsa.core.prompt_sections import FEEDBACK, NUMERICS, SENSITIVITIES, read_sections
from bsa.core.run.journal import read_events
from bsa.core.run.loop import RunResult
from bsa.core.scaffold import Scaffold
from bsa.core.sensitivities import Sensitivities
from bsa.plugins.agent.actions import Offer, check_action
from bsa.plugins.proposers.descent import PERFECT
from bsa_toy_cell import CAPACITY, HIDDEN, POLARISATION, RELAXATION, SERIES, toy_scaffold, toy_task
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

RunToy = Callable[..., RunResult]
KINDS = ("set", "refine", "jacobian", "restart", "reduce")


class Speaking:
    """A backend whose answers a function makes up."""

    name, sees_images = "speaking", False

    def __init__(self, answer: Callable[[JsonSchema, int, int], Mapping[str, Any] | str]) -> None:
        self._answer = answer
        self.calls = 0
        self.prompts: list[str] = []

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        self.calls += 1
        self.prompts.append(messages[-1].text)
        answer = self._answer(schema, seed, self.calls)
        return Reply(answer if isinstance(answer, str) else json.dumps(answer))

    def close(self) -> None:
        pass


def words(action: str, **more: Any) -> dict[str, Any]:
    return {"analysis": "a", "hypothesis": "h", "rationale": "r", "action": action, **more}


def at_random(schema: JsonSchema, seed: int, call: int) -> dict[str, Any]:
    rng = np.random.default_rng(seed)
    names = list(schema["properties"]["updated_params"]["properties"])
    chosen = [name for name in names if rng.random() < 0.5] or names[:1]
    return words(
        str(rng.choice(KINDS)),
        simulations=int(rng.integers(1, 40)),
        trial=int(rng.integers(0, 12)),
        params=chosen,
        updated_params={name: f"*{np.exp(0.5 * rng.standard_normal()):.4g}" for name in chosen},
    )


def spendthrift(schema: JsonSchema, seed: int, call: int) -> dict[str, Any]:
    return words(("jacobian", "restart", "reduce")[call % 3], simulations=40, trial=0)


def nonsense(schema: JsonSchema, seed: int, call: int) -> str:
    return "I would rather talk about the weather."


def deaf(schema: JsonSchema, seed: int, call: int) -> str:
    if call % 3:
        raise PromptRefused("too long")
    return nonsense(schema, seed, call)


BACKENDS: dict[str, Callable[[], Backend]] = {
    "random": RandomAdvice,
    "adversarial": AdversarialAdvice,
    "spendthrift": lambda: Speaking(spendthrift),
    "nonsense": lambda: Speaking(nonsense),
    "deaf": lambda: Speaking(deaf),
}


def search(run_toy: RunToy, folder: Path, name: str, budget: int, hidden: dict[str, float], **more: Any) -> RunResult:
    config = {"simulations": budget, "rounds": budget, "warm_up": 0}
    return run_toy(folder, task=toy_task(hidden), scaffold=more.pop("scaffold", toy_scaffold(name)), **config, **more)


@pytest.mark.slow
@pytest.mark.parametrize("who", BACKENDS)
@pytest.mark.parametrize("budget", [12, 35])
def test_no_backend_does_harm(run_toy: RunToy, tmp_path: Path, who: str, budget: int) -> None:
    for number, hidden in enumerate(hidden_cells(2)):
        plain = search(run_toy, tmp_path / f"plain-{number}", "least-squares", int(0.8 * budget), hidden)
        backend = BACKENDS[who]()
        mixed = search(run_toy, tmp_path / f"mixed-{number}", "hybrid", budget, hidden, backend=backend)
        assert does_as_well(mixed, plain), number


def does_as_well(mixed: RunResult, plain: RunResult) -> bool:
    # Where below a perfect fit it ends is chance.
    return mixed.lowest.misfit <= PERFECT or mixed.lowest.objective <= plain.lowest.objective + 1e-12


def hidden_cells(count: int) -> list[dict[str, float]]:
    rng = np.random.default_rng(11)
    return [
        {
            CAPACITY: rng.uniform(0.7, 2.5),
            SERIES: rng.uniform(0.01, 0.2),
            POLARISATION: rng.uniform(0.01, 0.2),
            RELAXATION: rng.uniform(40.0, 800.0),
        }
        for _ in range(count)
    ]


@pytest.mark.slow
@pytest.mark.parametrize("who", ["adversarial", "nonsense", "deaf"])
def test_the_fit_asks_for_the_same_points_where_the_agent_finds_nothing(
    run_toy: RunToy, tmp_path: Path, who: str
) -> None:
    plain = search(run_toy, tmp_path / "plain", "least-squares", 60, HIDDEN)
    mixed = search(run_toy, tmp_path / "mixed", "hybrid", 60, HIDDEN, backend=BACKENDS[who]())
    ours = [dict(trial.candidate) for trial in mixed.trials]
    places = [ours.index(dict(trial.candidate)) for trial in plain.trials]
    assert places == sorted(places)
    # At least four of five simulations belong to the fit until it has ended.
    assert len(plain.trials) >= 0.8 * (places[-1] + 1)


@pytest.mark.slow
def test_rules_do_as_well_as_least_squares_alone(run_toy: RunToy, tmp_path: Path) -> None:
    for number, hidden in enumerate(hidden_cells(3)):
        plain = search(run_toy, tmp_path / f"plain-{number}", "least-squares", 30, hidden)
        mixed = search(run_toy, tmp_path / f"mixed-{number}", "hybrid", 30, hidden, backend=RulesBackend())
        assert does_as_well(mixed, plain), number


def test_a_better_point_becomes_the_fits_at_once(run_toy: RunToy, tmp_path: Path) -> None:
    near = {name: value * 1.02 for name, value in HIDDEN.items()}

    def wise(schema: JsonSchema, seed: int, call: int) -> dict[str, Any]:
        return words("set", updated_params={name: f"{value:.6g}" for name, value in near.items()})

    mixed = search(run_toy, tmp_path / "mixed", "hybrid", 12, HIDDEN, backend=Speaking(wise))
    events = [event for event in read_events(tmp_path / "mixed") if event["event"] == "proposal"]
    told = [author for event in events for author in event["details"]["authors"]]
    assert len(told) == len(mixed.trials) - 1
    found = told.index("agent") + 1
    after = [trial for trial in mixed.trials[found + 1 :] if told[trial.index - 1] == "fit"]
    assert all(trial.misfit < mixed.trials[0].misfit / 5 for trial in after)


def test_an_agent_that_leads_can_go_on(run_toy: RunToy, tmp_path: Path) -> None:
    def closer(schema: JsonSchema, seed: int, call: int) -> dict[str, Any]:
        off = 1.0 + 0.002 * 0.05 ** (call - 1)
        return words("set", updated_params={name: f"{value * off:.6g}" for name, value in HIDDEN.items()})

    backend = Speaking(closer)
    search(run_toy, tmp_path, "hybrid", 9, HIDDEN, backend=backend)
    ((_, told),) = [part for part in read_sections(backend.prompts[-1]) if part[0] == NUMERICS]
    assert told["misfit_tolerances_by_round"][-1] < told["misfit_tolerances_by_round"][0]
    proposals = [event for event in read_events(tmp_path) if event["event"] == "proposal"]
    # A fifth of eight simulations would be one.
    assert [event["details"]["authors"] for event in proposals[1:]] == [["fit", "agent"], ["fit", "agent"]]


@pytest.mark.slow
def test_a_good_idea_is_taken_up_once_the_fit_is_at_a_loss(run_toy: RunToy, tmp_path: Path) -> None:
    # Nothing simulates above 0.03 Ohm, and the rules of thumb do not know this cell's parameters.
    scaffold = Scaffold.model_validate(
        {
            **toy_scaffold("hybrid").model_dump(),
            "simulator": {"use": "toy-cell", "options": {"breaks_above_ohm": 0.0055}},
        }
    )
    hidden = {**HIDDEN, SERIES: 0.0052}

    def wise(schema: JsonSchema, seed: int, call: int) -> dict[str, Any]:
        return words("set", updated_params={SERIES: "0.0051"})

    plain = search(run_toy, tmp_path / "plain", "least-squares", 60, hidden, scaffold=with_proposer(scaffold))
    mixed = search(run_toy, tmp_path / "mixed", "hybrid", 60, hidden, scaffold=scaffold, backend=Speaking(wise))
    assert mixed.lowest.objective < 0.05
    assert mixed.lowest.objective < plain.lowest.objective


def with_proposer(scaffold: Scaffold) -> Scaffold:
    return Scaffold.model_validate({**scaffold.model_dump(), "proposer": "least-squares"})


@pytest.mark.slow
@given(st.lists(st.sampled_from(KINDS), min_size=1, max_size=8), st.integers(0, 1000))
@settings(max_examples=6, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_sequence_of_actions_is_carried_out(
    run_toy: RunToy, tmp_path_factory: pytest.TempPathFactory, kinds: list[str], seed: int
) -> None:
    def scripted(schema: JsonSchema, _: int, call: int) -> dict[str, Any]:
        return {**at_random(schema, seed, call), "action": kinds[call % len(kinds)]}

    folder = tmp_path_factory.mktemp("any")
    result = search(run_toy, folder, "hybrid", 35, HIDDEN, backend=Speaking(scripted))
    assert len(result.trials) <= 35
    assert result.lowest.objective < 1.0


@pytest.mark.slow
def test_a_run_that_was_cut_goes_on_as_it_would_have(run_toy: RunToy, tmp_path: Path) -> None:
    whole = search(run_toy, tmp_path / "whole", "hybrid", 30, HIDDEN, backend=Speaking(at_random))
    lines = (tmp_path / "whole" / "journal.jsonl").read_bytes().splitlines(keepends=True)
    for kept in range(1, len(lines), 11):
        folder = tmp_path / f"cut-{kept}"
        folder.mkdir()
        (folder / "journal.jsonl").write_bytes(b"".join(lines[:kept]))
        resumed = search(run_toy, folder, "hybrid", 30, HIDDEN, backend=Speaking(at_random))
        assert [dict(t.candidate) for t in resumed.trials] == [dict(t.candidate) for t in whole.trials]


def test_the_agent_reads_what_the_jacobian_taught(run_toy: RunToy, tmp_path: Path) -> None:
    backend = Speaking(lambda schema, seed, call: words("refine", simulations=1))
    search(run_toy, tmp_path, "hybrid", 25, HIDDEN, backend=backend)
    sections = dict(read_sections(backend.prompts[0]))
    effects = Sensitivities.read(
        sections[SENSITIVITIES], tuple(Feedback.read(sections[FEEDBACK]).numbers), tuple(toy_task().space.names)
    ).effects
    assert CAPACITY in effects
    assert "## Numerics" in backend.prompts[0]
    assert '"status": "descending"' in backend.prompts[0]
    ((_, told),) = [part for part in read_sections(backend.prompts[0]) if part[0] == NUMERICS]
    capacity = 1 + toy_task().space.names.index(CAPACITY)
    record = told["the_record"]["leaves_open"] + told["the_record"]["narrows"]
    assert capacity not in record
    assert all(isinstance(number, int) for number in record)
    assert "move_the_features_alike" not in backend.prompts[0]
    assert "## Priors" not in backend.prompts[0]
    proposals = [event for event in read_events(tmp_path) if event["event"] == "proposal"]
    assert any(event["action"] == "refine" and event["hypothesis"] == "h" for event in proposals)


def test_effects_are_measured_of_the_parameters_asked_for_alone(run_toy: RunToy, tmp_path: Path) -> None:
    half = {"use": "hybrid", "options": {"agent_share": 0.5}}
    scaffold = Scaffold.model_validate({**toy_scaffold("hybrid").model_dump(), "proposer": half})
    backend = Speaking(lambda schema, seed, call: words("jacobian", params=[SERIES], simulations=1))
    mixed = search(run_toy, tmp_path, "hybrid", 25, HIDDEN, scaffold=scaffold, backend=backend)
    events = [event for event in read_events(tmp_path) if event["event"] == "proposal"]
    told = [author for event in events for author in event["details"]["authors"]]
    earlier = lambda trial: [dict(other.candidate) for other in mixed.trials[: trial.index]]  # noqa: E731
    searched = [trial for trial in mixed.trials[1:] if told[trial.index - 1] == "agent"]
    assert len(searched) > 4
    for trial in searched:
        assert any({**other, SERIES: trial.candidate[SERIES]} == dict(trial.candidate) for other in earlier(trial))


def test_wishes_are_checked() -> None:
    space = toy_task().space
    offer = Offer(("refine", "set", "jacobian", "restart", "reduce"), space)
    check = lambda reply: check_action(reply, offer, space.initial, [])  # noqa: E731
    for reply, message in (
        (words("explode"), '"action" is "explode"'),
        (words("set"), 'no object "updated_params"'),
        (words("refine", params=["Capacity"]), "not a searched parameter"),
        (words("restart", trial=3), "ran to its end"),
        (words("restart", trial="first"), "ran to its end"),
    ):
        with pytest.raises(BsaError, match=message):
            check(reply)
    assert check(words("refine", params=list(space.names))).carries_on
    assert check(words("refine", simulations=10**9)).simulations == 40
    assert check(words("refine", simulations=float("nan"))).simulations == 5
