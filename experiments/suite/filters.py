"""The two filters of the paper: a case must run, and must differ from its base cell by 1 % of capacity."""

from typing import Any

from ...core.parameters import Candidate
from ...core.simulation import ExperimentRun
from ...core.target import Value
from .case import SuiteCase
from .target import cell_of, discharged_in_scored_part, experiment_of, reference_run

LEAST_CAPACITY_CHANGE = 0.01


def passes(case: SuiteCase) -> bool:
    """Whether the true cell runs to its end and its capacity differs by 1 % or more from the base cell's.

    A base cell that cannot run the protocol differs enough.
    """
    if not case.changes:
        return False
    cell, experiment = cell_of(case), experiment_of(case)
    true = discharged_in_scored_part(reference_run(cell, experiment, case.hidden), experiment)
    base = discharged_in_scored_part(reference_run(cell, experiment, {}), experiment) if true else None
    return _differs(true, base)


def _differs(true_ah: float | None, base_ah: float | None) -> bool:
    if true_ah is None:
        return False
    return base_ah is None or abs(true_ah - base_ah) >= LEAST_CAPACITY_CHANGE * base_ah


class CompiledFilter:
    """The same filters on models that are compiled once for each cell and protocol.

    For going through hundreds of cases whose targets are not needed yet: five times faster than `passes`. ``searched``
    is every parameter that a case may change.
    """

    def __init__(self, searched: tuple[str, ...]) -> None:
        self._searched = searched
        self._compiled: dict[tuple[str, str], tuple[Any, float | None]] = {}

    def __call__(self, case: SuiteCase) -> bool:
        """Whether the case passes."""
        key = (case.parameter_set, case.rates)
        if key not in self._compiled:
            self._compiled[key] = self._compile(case)
        compiled, base_ah = self._compiled[key]
        return _differs(self._capacity(compiled, case, case.hidden), base_ah)

    def _compile(self, case: SuiteCase) -> tuple[Any, float | None]:
        from ...plugins.pybamm.cells.parameter_sets import pybamm
        from ...plugins.pybamm.solving.compiled import CompiledExperiment

        pybamm.set_logging_level("CRITICAL")
        compiled = CompiledExperiment(
            cell_of(case), experiment_of(case), {name: Value(name) for name in self._searched}
        )
        return compiled, self._capacity(compiled, case, {})

    def _capacity(self, compiled: Any, case: SuiteCase, changes: Candidate) -> float | None:
        from ...plugins.pybamm.cells.parameter_sets import initial_value

        base = {name: initial_value(case.parameter_set, name) for name in self._searched}
        run: ExperimentRun = compiled.solve({**base, **changes})
        return discharged_in_scored_part(run, experiment_of(case))
