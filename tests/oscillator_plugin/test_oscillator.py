"""The oscillator and its task keep what a simulator and a task promise."""

import pytest
from bsa.core.task import Task
from bsa.testing import SimulatorConformance, TaskConformance
from bsa_oscillator import oscillator_task


class TestOscillator(SimulatorConformance):
    @pytest.fixture
    def name(self) -> str:
        return "oscillator"

    @pytest.fixture
    def task(self) -> Task:
        return oscillator_task()


class TestOscillatorTask(TaskConformance):
    @pytest.fixture
    def name(self) -> str:
        return "oscillator"
