"""Fixtures that several test modules of the experiments share."""

import numpy as np
import pandas as pd
import pytest
from bsa.experiments.discovery_bench.hidden_cell import Hidden, measure
from bsa.experiments.discovery_bench.hidden_physics import EFFECTS
from bsa.experiments.discovery_bench.protocols import Step


@pytest.fixture(scope="module", autouse=True)
def _simulated_here(simulated_here: None) -> None:
    """Every process would import PyBaMM and compile the models anew; commands that tests start have processes."""


@pytest.fixture
def resistive_cell() -> pd.DataFrame:
    """Half an hour at 1C and a pulse at 2C, of a cell whose contacts have 20 mohm; discharge is positive."""
    (resistance,) = (effect for effect in EFFECTS if effect.key == "contact-resistance")
    hidden = Hidden("Chen2020", "SPM", (resistance,), {resistance.strength: 0.02})
    steps = [Step(0.0, 200.0), Step(1.0, 1500.0), Step(0.0, 900.0), Step(2.0, 60.0, period=2.0), Step(0.0, 300.0)]
    record, _ = measure(hidden, steps, 0.9, 298.15, np.random.default_rng(8))
    return pd.DataFrame({"time [s]": record.time, "current [A]": record.current, "voltage [V]": record.voltage})
