"""From what a person typed to what a run needs."""

from functools import partial

import numpy as np
import pytest
from bsa.core.record import Record
from bsa.core.segmentation import segment
from bsa.core.trajectory import Trajectory
from bsa.experiments.request import run_request
from bsa.experiments.run_settings import run_config
from bsa.experiments.task_request import CellChoice, Records
from bsa.experiments.tasks.find import find_task


def discharge() -> Record:
    time = np.arange(0.0, 3001.0, 30.0)
    current = np.where(time < 300.0, 0.0, 5.0)
    return Record("a", segment(Trajectory(time, current, 4.1 - 2e-4 * time)), ambient_k=298.15)


@pytest.mark.parametrize(
    ("scaffold", "backend", "search", "as_protocol", "wanted"),
    [
        (None, "rules", None, False, "staged"),
        (None, "litellm:openai/o3", None, False, "hybrid"),
        (None, "rules", "geometry", False, "hybrid"),  # which has no priors
        (None, "rules", None, True, "hybrid"),
        ("least-squares", "rules", None, False, "least-squares"),
    ],
)
def test_measured_records_are_fitted_in_stages_where_nobody_says_how(
    scaffold, backend, search, as_protocol, wanted, tmp_path
) -> None:
    """Without priors one record of a measured cell moves corrections of its potentials to their bounds."""
    records = Records([discharge()], as_protocol=as_protocol)
    cell = CellChoice("Chen2020", None, {}, search)
    configured = partial(run_config, scaffold, backend, {}, {})
    found = run_request(None, records, cell, configured, None, tmp_path / "run")
    assert found.config.scaffold.name == wanted


def test_a_task_is_solved_by_the_hybrid(tmp_path) -> None:
    configured = partial(run_config, None, "rules", {}, {"patience": 5})
    found = run_request(find_task("demo"), Records(()), CellChoice(), configured, None, tmp_path / "run")
    assert (found.config.scaffold.name, found.config.patience) == ("hybrid", 5)
