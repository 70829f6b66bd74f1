"""What to measure next is looked for with what is left of two budgets."""

from types import SimpleNamespace

import numpy as np
import pytest
from bsa.core.inference.measure_next import suggestions
from bsa.core.inference.simulating import Spent
from bsa_toy_cell import toy_task


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
