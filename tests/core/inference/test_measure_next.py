"""What to measure next is looked for with what is left of two budgets."""

from types import SimpleNamespace

import numpy as np
import pytest
from bsa.core.inference.measure_next import suggestions, what_to_measure_next
from bsa.core.inference.simulating import Spent
from bsa_toy_cell import toy_task

NAMES = ("radius [m]", "porosity", "exponent")


@pytest.mark.parametrize(
    ("budget", "made", "unused", "lacking"),
    [(60, 0, 0, 0), (60, 58, 0, 13), (60, 58, 85, 0), (60, 70, 10, 5), (0, 0, 15, 0)],
)
def test_what_the_search_left_goes_to_further_records(budget, made, unused, lacking) -> None:
    """The demonstration took 15 of 100 simulations, and 12 were lacking for what to measure next."""
    task, looked = toy_task(), []

    def simulate_variant(candidates, experiments):
        looked.append((len(candidates), len(experiments)))

    names = task.space.names
    protocols = dict.fromkeys("abc", (("Discharge at 1C until 3 V",),))
    plugins = SimpleNamespace(next_protocols=lambda: protocols, simulate_variant=simulate_variant)
    best = SimpleNamespace(candidate=task.space.initial)
    spent = Spent(budget, made, unused=unused)
    open_in_all = np.zeros((40, len(names)))
    found = suggestions(task, best, open_in_all, 1.0, dict.fromkeys(names, 1.0), plugins, spent)
    assert found == ((), lacking)
    # Four parameters that nothing determines, and the best candidate, in three protocols.
    assert looked == ([] if lacking else [(5, 3)])


def test_the_next_measurement_is_the_one_that_shows_what_is_open() -> None:
    rng = np.random.default_rng(6)
    known = rng.normal(size=(40, 3)) * [80.0, 80.0, 0.1]
    candidates = {
        "the same again": known,
        "shows the exponent": rng.normal(size=(20, 3)) * [0.0, 0.0, 60.0],
        "shows the porosity": rng.normal(size=(20, 3)) * [0.0, 300.0, 0.0],
    }
    now = dict.fromkeys(NAMES, 0.05) | {"exponent": 0.4}
    ranked = what_to_measure_next(known, candidates, now, noise=1.0)
    first, second, _ = ranked
    assert first == "shows the exponent"
    assert max(ranked[first].values()) < 0.1 < max(ranked[second].values()) == ranked[second]["exponent"]


def test_a_record_that_shows_nothing_narrows_no_interval_however_wide_a_linear_model_has_it() -> None:
    known = np.random.default_rng(6).normal(size=(40, 3))
    now = dict(zip(NAMES, (0.38, 0.02, 0.3), strict=True))
    found = what_to_measure_next(known, {"nothing": np.zeros((20, 3))}, now, noise=1.0)
    assert found == {"nothing": pytest.approx(now)}
