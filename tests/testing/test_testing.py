"""The conformance classes find what is wrong with a plugin, and cost little to import."""

import os
import re
import subprocess
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path

import bsa.testing
import pytest
from bsa.core.contracts.kinds import KINDS

PLUGINS = """
import random, time
import numpy as np
from pydantic import BaseModel
from bsa.backends.options import BackendOptions
from bsa.backends.route import NotReady, Route
from bsa.core.effect import Effect, EffectParameter, Measurement
from bsa.core.feedback import Feedback
from bsa.core.hooks import Entry, Recollection, hookimpl
from bsa.core.messages import Reply
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.proposal import Proposal
from bsa.core.reading.samples import Samples
from bsa.core.simulation import ExperimentRun, Outcome
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.trajectory import Step, Trajectory

class Undescribed(BaseModel):
    size: float = 1.0

class Wrong:
    def __init__(self, options, context=None):
        self.context = context

class Millivolts(Wrong):
    @hookimpl
    def simulate(self, candidates):
        target = self.context.task.experiments[0].target
        for place, candidate in enumerate(candidates):
            random_v = 1000.0 * target.voltage + random.random()
            run = Trajectory(target.time, -target.current, random_v, steps=target.steps)
            yield place, Outcome((ExperimentRun(run),))

class Mute(Wrong):
    @hookimpl
    def build_feedback(self, metrics):
        return Feedback({"error": random.random()}) if metrics else Feedback()

class Talkative(Wrong):
    @hookimpl
    def recall(self, budget):
        return Recollection("Notes", {"text": "x" * budget, "again": random.random()})

class Gambler(Wrong):
    @hookimpl
    def propose(self, context):
        if context.round == 1:
            return Proposal((context.task.space.initial,))
        self.context.backend.complete([], {}, seed=1).text[0]
        return Proposal((context.task.space.sample(np.random),))

class Eager(Wrong):
    @hookimpl
    def warm_up(self, context):
        return Proposal((context.task.space.initial,) * (context.simulations_left + 1))

class Liar(Wrong):
    name, sees_images = "liar", False
    def complete(self, messages, schema, *, seed):
        if not schema.get("properties"):
            raise KeyError("properties")
        return Reply("not JSON", structured_by="schema")
    def close(self): pass

class Slow(Route):
    def check(self, model):
        time.sleep(0.6)
        return NotReady("no idea", "")
    def open(self, model, name):
        raise ValueError(model)

class Greedy(Wrong):
    def matches(self, path):
        return True
    def read(self, path, options):
        return Samples(path.name, *np.loadtxt(path).T + random.random())

def nowhere(options):
    size = EffectParameter("size", "V", 0.0, -1.0, 1.0, 0.1)
    shown = lambda voltage, current, values: voltage + 0.1
    return Effect("zz-effect", "", "V", (size,), "all", "none", measurement=Measurement(voltage=shown))

def moody(options):
    time = np.arange(20.0)
    record = Trajectory(time, time, time + random.random())
    space = ParameterSpace((Parameter("A", 1.0, 0.0, 2.0),))
    return Task("zz", CellModel("", "none"), space, (Experiment("e", record),), simulator="zz-nobody")

ENTRIES = {
    "bsa_simulators": Entry("zz-simulator", Millivolts, "Two\\nlines.", api=1),
    "bsa_feedback_builders": Entry("zz-feedback", Mute, "", api=1),
    "bsa_memories": Entry("zz-memory", Talkative, "Much.", Undescribed, api=1),
    "bsa_proposers": Entry("zz-proposer", Gambler, "Draws.", api=1),
    "bsa_warm_ups": Entry("zz-warm-up", Eager, "More.", api=1),
    "bsa_backends": Entry("zz-backend", Liar, "Lies.", api=1),
    "bsa_routes": Entry("zz-route", Slow, "Slow.", BackendOptions, api=1),
    "bsa_readers": Entry("zz-reader", Greedy, "All.", api=1),
    "bsa_effects": Entry("zz-effect", nowhere, "No.", api=1),
    "bsa_tasks": Entry("zz-task", moody, "Moody.", api=1),
}
for hook, entry in ENTRIES.items():
    def entries(entry=entry):
        return [entry]
    globals()[hook] = hookimpl(entries)
"""

TESTS = """
import pytest
import bsa.testing as kinds
from bsa.testing import route

route._LONGEST_LOOK_S *= 0.1

def conformance(base):
    class TestIt(base):
        @pytest.fixture
        def name(self):
            return f"zz-{self.kind}"
        @pytest.fixture
        def options(self):
            return {"size": 1.0} if self.kind == "memory" else {}
        @pytest.fixture
        def file(self, tmp_path):
            path = tmp_path / "cell.ticks"
            path.write_text("".join(f"{10 * k} {4.0 - 0.01 * k} {-(k > 3)}\\n" for k in range(40)))
            return path
    return TestIt

for kind in kinds.__all__:
    if kind.endswith("Conformance") and kind != "EntryConformance":
        globals()[f"Test{kind}"] = conformance(getattr(kinds, kind))
"""

FOUND = {
    "Simulator": {
        "test_its_summary_is_one_line",
        "test_a_candidate_has_one_outcome_wherever_it_stands",
        "test_signals_have_the_units_of_the_record",
        "test_a_measured_drive_is_followed",
    },
    "Feedback": {
        "test_its_summary_is_one_line",
        "test_the_same_outcome_has_the_same_feedback",
        "test_something_is_told_of_a_failure",
    },
    "Memory": {
        "test_its_options_have_defaults_and_descriptions",
        "test_an_unknown_option_is_refused",
        "test_the_budget_is_kept",
        "test_nothing_need_be_known",
    },
    "Proposer": {
        "test_a_run_that_was_cut_resumes_to_the_same_trials",
        "test_a_useless_reply_ends_nothing",
    },
    "WarmUp": {"test_it_perturbs_within_its_limit"},
    "Backend": {"test_a_question_has_a_reply", "test_a_strange_question_has_a_reply_or_is_lost"},
    "Route": {"test_a_look_is_short_and_says_what_to_do", "test_a_missing_model_is_told"},
    "Reader": {
        "test_a_strange_file_is_not_its_own",
        "test_the_record_is_the_same_each_time",
        "test_a_damaged_file_is_told",
    },
    "Effect": {"test_it_is_described", "test_an_instrument_without_it_shows_the_truth"},
    "Task": {
        "test_its_simulator_is_there",
        "test_its_records_are_cut_into_steps",
        "test_it_is_the_same_each_time_and_in_a_journal",
    },
}
"""Tests that fail for the plugins above, by kind; others may fail with them."""


@pytest.fixture
def failed(stranger: Callable[..., Path], tmp_path: Path) -> set[tuple[str, str]]:
    """Kind and name of each test that fails for a plugin that breaks its promise."""
    folder = stranger(PLUGINS)
    file = tmp_path / "test_strangers.py"
    file.write_text(textwrap.dedent(TESTS))
    paths = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-m", "pytest", "-rfE", "--tb=no", "-p", "no:cacheprovider", "-c", os.devnull, str(file)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=os.environ | {"PYTHONPATH": paths})
    return set(re.findall(r"(?:FAILED|ERROR) \S*::Test(\w+)Conformance::(\w+)", done.stdout))


@pytest.mark.slow
def test_what_a_plugin_breaks_is_found(failed: set[tuple[str, str]]) -> None:
    wanted = {(kind, test) for kind, tests in FOUND.items() for test in tests}
    assert wanted - failed == set()


def test_there_is_a_class_for_each_kind() -> None:
    kinds = {getattr(bsa.testing, name).kind for name in bsa.testing.__all__ if name[:5] != "Entry" and name[0] != "s"}
    assert kinds == set(KINDS)


@pytest.mark.slow
def test_the_import_loads_no_heavy_library() -> None:
    heavy = "{'pybamm', 'pandas', 'matplotlib', 'litellm', 'torch', 'transformers', 'openpyxl'}"
    subprocess.run(
        [sys.executable, "-c", f"import bsa.testing, sys; assert not {heavy} & set(sys.modules)"], check=True
    )


def test_without_pytest_the_import_says_how_to_install_it() -> None:
    code = "import sys; sys.modules['pytest'] = None; import bsa.testing"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert 'pip install "battery-sim-agent[testing]"' in done.stderr
