"""The toy keeps what a simulator promises."""

import pytest
from bsa.core.task import Task
from bsa.testing import SimulatorConformance
from bsa_toy_cell import toy_task


class TestToyCell(SimulatorConformance):
    @pytest.fixture
    def name(self) -> str:
        return "toy-cell"

    @pytest.fixture
    def task(self) -> Task:
        return toy_task(simulator="toy-cell")
