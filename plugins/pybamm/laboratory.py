"""The laboratory of a discovery, run by PyBaMM."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence

from ...core.discovery.laboratory import Prediction, Specimen
from ...core.effect import Effect
from ...core.errors import BsaError
from ...core.parameters import Candidate
from ...core.task import CellModel
from ...core.trajectory import FloatArray
from .driven_cell import FINE, SEARCH, DrivenCell, Resolution

_KEPT = 80
"""Compiled models that are kept warm; each takes a few megabytes."""


class PyBaMMLaboratory:
    """Keeps compiled models of a cell with its effects and solves them.

    Parameters
    ----------
    cell : CellModel
        The base model.
    searched : sequence of str
        Base parameters that candidates set.
    usual, fine : Resolution
        Mesh and tolerances of the search and of the check on it.
    """

    def __init__(
        self, cell: CellModel, searched: Sequence[str], usual: Resolution = SEARCH, fine: Resolution = FINE
    ) -> None:
        self._cell = cell
        self._searched = tuple(searched)
        self._resolutions = {False: usual, True: fine}
        self._compiled: OrderedDict[tuple[tuple[str, ...], int, bool], DrivenCell | None] = OrderedDict()
        self._specimens: list[Specimen] = []
        self.simulations = 0
        self.refused: dict[str, str] = {}

    def predict(
        self,
        effects: Sequence[Effect],
        candidate: Candidate,
        specimen: Specimen,
        times: FloatArray,
        current: FloatArray,
        fine: bool = False,
    ) -> Prediction | None:
        """Simulate; see `Laboratory.predict`."""
        driven = self._driven(tuple(effects), specimen, fine)
        if driven is None:
            return None
        self.simulations += 1
        curve = driven.solve(candidate, times, current)
        return None if curve is None else Prediction(curve.voltage, curve.temperature)

    def _driven(self, effects: tuple[Effect, ...], specimen: Specimen, fine: bool) -> DrivenCell | None:
        # The specimen itself is kept, so that its identity stays its own.
        if not any(specimen is known for known in self._specimens):
            self._specimens.append(specimen)
        key = (tuple(effect.key for effect in effects), id(specimen), fine)
        if key in self._compiled:
            self._compiled.move_to_end(key)
            return self._compiled[key]
        driven: DrivenCell | None
        try:
            driven = DrivenCell(
                self._cell, effects, specimen.record, self._searched, specimen.ambient_k, self._resolutions[fine]
            )
        except BsaError as error:
            if not effects:
                raise
            driven = None
            self.refused[" + ".join(effect.key for effect in effects)] = error.message
        self._compiled[key] = driven
        while len(self._compiled) > _KEPT:
            self._compiled.popitem(last=False)
        return driven
