"""The study of hidden mechanisms: its lives, and its rows."""

from pathlib import Path

import numpy as np
import pytest
from bsa.core.discovery.explanation import Explanation
from bsa.core.discovery.findings import Findings, Gap
from bsa.core.inference.adequacy import Adequacy
from bsa.core.inference.refit import Refit
from bsa.core.parameters import ParameterSpace
from bsa.experiments.studies.life_discovery import HIDDEN, MEASURED, items, make, modes_table, row_of
from bsa.plugins.effects.ageing import EFFECTS


def test_every_hidden_mechanism_has_a_name_of_the_catalogue() -> None:
    assert {hidden.name for hidden in HIDDEN.values()} <= {effect.name for effect in EFFECTS if effect.ages}


@pytest.mark.slow
@pytest.mark.parametrize("case", HIDDEN)
def test_a_hidden_life_is_cycled_between_its_limits(case: str, tmp_path: Path) -> None:
    make(HIDDEN[case], tmp_path / "life.csv", 0, 3)
    time_s, current, voltage = np.loadtxt(tmp_path / "life.csv", delimiter=",", skiprows=1, unpack=True)
    assert np.all(np.diff(time_s) >= 0)
    assert np.count_nonzero(np.diff(np.sign(current)) < 0) >= 3
    assert 2.48 < voltage.min() < 2.55
    assert 4.19 < voltage.max() < 4.21


def test_an_explanation_that_was_not_accepted_names_nothing() -> None:
    fit = Refit(ParameterSpace(()), np.zeros(0), np.zeros(9), np.zeros((9, 0)), True)
    base = Explanation((), fit, Adequacy(0.0, 0.0, 1.0), 5e-3, 9e-3, np.zeros(9), np.ones(9))
    row = row_of("diffusion", Findings("unexplained", Gap(base, base, 1e-3, 1e-3), base, reason="why"), 12.0)
    assert (row["hidden"], row["named"], row["rivals"]) == ("sei-growth", "", "")
    assert (row["base_error"], row["later_error"]) == (pytest.approx(5.0), pytest.approx(9.0))


def test_a_measured_life_is_asked_where_its_records_are_said_to_be(tmp_path: Path) -> None:
    assert list(items(None)) == [*HIDDEN]
    assert list(items(tmp_path)) == [*HIDDEN, *MEASURED]
    assert items(tmp_path)["CS2_35"]["record"] == tmp_path / "calce_cs2" / "CS2_35_all.csv.gz"


def test_a_life_without_one_of_the_quantities_has_a_dash_there() -> None:
    row = {"task": "a", "quantity": "lithium", "cycle": 200.0, "value": 5.0, "half": 0.5}
    table = modes_table([row, {**row, "quantity": "resistance"}, {**row, "task": "b"}])
    assert table.splitlines()[2:] == ["| a (200) | 5 ± 0.5 | 5 ± 0.5 |", "| b (200) | 5 ± 0.5 | – |"]
