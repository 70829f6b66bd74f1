"""What ``bsa.discover`` returns."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...core.discovery.discovery import Discovery
from ...core.discovery.explanation import Estimate
from ..report.base_parameters import base_parameters
from ..report.discovery_lines import untried_line
from ..report.page import FILE_NAME as REPORT
from ..report.wording import number, quantity
from .notebook import pictures_of, render
from .scripts import namespace_of

if TYPE_CHECKING:
    import pybamm


@dataclass(frozen=True, eq=False)
class DiscoveryResult:
    """What was found to be missing; a notebook shows it as tables and curves.

    Attributes
    ----------
    folder : Path
        Journal, ``discovery.json``, ``augmented_model.py`` and report.
    """

    folder: Path
    _found: Discovery = field(repr=False)

    @property
    def verdict(self) -> str:
        """``"effect-found"``, ``"no-missing-effect"``, ``"ambiguous"`` or ``"unexplained"``."""
        return self._found.verdict

    @property
    def headline(self) -> str:
        """The verdict as a sentence: whether an effect explains all of the discrepancy or a part of it."""
        return self._found.headline

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects found; empty unless the verdict is ``"effect-found"`` or ``"ambiguous"``."""
        return self._found.names

    @property
    def notes(self) -> tuple[str, ...]:
        """What was assumed, repaired or settled."""
        return (*self._found.notes, *filter(None, [untried_line(self._found)]))

    @property
    def parameters(self) -> dict[str, float]:
        """Fitted values by name: factors and states of the base model, and the effects' parameters."""
        return self._found.parameters

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """95 % intervals of the effects' parameters, by ``"EFFECT: PARAMETER"``, as ``parameters`` counts them."""
        return {name: estimate.ci95 for name, estimate in self._estimates.items()}

    @property
    def _estimates(self) -> dict[str, Estimate]:
        best = self._found.findings.best
        return {
            f"{effect.key}: {estimate.name}": estimate
            for effect in best.effects
            for estimate in best.estimates[effect.key]
        }

    @property
    def errors(self) -> dict[str, dict[str, float | None]]:
        """``"initial"`` (base model, fitted) and ``"best"`` (with the effects) error, by name and unit."""
        return self._found.errors

    @property
    def report(self) -> Path:
        """The report, one self-contained page."""
        return self.folder / REPORT

    @property
    def parameter_values(self) -> pybamm.ParameterValues:
        """The fitted set with the effects' values; temperature and start are the first record's.

        Nominal capacity, and the current of 1C, are those of the cell's size. ``augmented_model.py`` has the records'
        currents.
        """
        if "augmented_model" in self._script:
            return self._script["parameter_values"](measured_current=False)
        values = self._script["parameter_values"]()  # of a life
        values["Current function [A]"] = values["Nominal cell capacity [A.h]"]
        return values

    @property
    def model(self) -> pybamm.BaseBatteryModel:
        """The augmented model; only ``augmented_model.py`` has what an effect of the instrument does to a reading."""
        return self._script["model" if "model" in self._script else "augmented_model"]()

    @cached_property
    def _script(self) -> dict[str, Any]:
        return namespace_of(self._found.script, "augmented_model")

    def to_json(self) -> dict[str, Any]:
        """The contents of ``discovery.json``: plain dicts, lists, strings and numbers."""
        return self._found.to_json()

    def __repr__(self) -> str:
        name, error = next(iter(self.errors.items()))
        return (
            f"<DiscoveryResult {self.verdict}: {', '.join(self.effects) or 'no effect'}, {name} "
            f"{number(error['initial'])} → {number(error['best'])}; {self.report}>"
        )

    def _repr_html_(self) -> str:
        return render(
            "discovery.html.j2",
            title=f"{self.verdict}: {', '.join(self.effects) or self._found.findings.reason}",
            headline=self.headline,
            reason=self._found.findings.reason if self.effects else "",
            errors=[(name, number(error["initial"]), number(error["best"])) for name, error in self.errors.items()],
            rows=[(name, *_quantities(estimate)) for name, estimate in self._estimates.items()],
            base=base_parameters(self._found),
            pictures=pictures_of(self.report, 2),  # drawn there: the curves need the simulator
            report=self.report,
        )


def _quantities(estimate: Estimate) -> tuple[str, str]:
    value, ci95, unit = estimate.physical
    return quantity(value, unit), " to ".join(quantity(end, unit) for end in ci95)
