"""The simulator of a discovery, run by PyBaMM."""

from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ....core.contracts.requests import MeasuredRecord, Prediction, Request
from ....core.effect import Effect
from ....core.errors import BsaError
from ....core.parameters import Candidate
from ....core.target import Target
from ....core.task import CellModel
from ....core.trajectory import StepKind
from ..augmentation import part_of
from ..modelling.compiled_cell import Start
from ..modelling.resolution import Resolution
from ..solving.driven_cell import FINE, SEARCH, DrivenCell, Response

_KEPT = 80
"""Compiled models that are kept warm; each takes a few megabytes."""

_RECENT = 12
"""Solved curves that are kept: every effect that is absent asks for the base model's again."""

CHEAPER = {"DFN": "SPMe"}
"""The cheaper model beside a base model: a simulation takes a fifth of the time. Beside SPMe there is SPM only, which
has no electrolyte."""

_RTOL_OF_MANY_CYCLES = 3e-6
"""Relative tolerance for records of many cycles. Errors of the charge add up: at 1e-5 the voltage after the twentieth
discharge jumps by ten millivolts from one candidate to the next, and no slope can be taken."""

_Key = tuple[tuple[str, ...], int, bool, bool]
"""Effects, identity of the record, whether on the fine mesh, whether on the cheaper model."""


class EffectSimulator:
    """Keeps compiled models of a cell with its effects and solves them.

    ``targets`` are what candidates set of the base parameters, by the names that they use; ``usual`` and ``fine`` mesh
    and tolerances of the search and of the check on it. A model is compiled once for the records of ``together``, which
    will all be asked for.
    """

    at_once = 1
    recalled = 0

    def __init__(
        self,
        cell: CellModel,
        targets: Mapping[str, Target],
        usual: Resolution = SEARCH,
        fine: Resolution = FINE,
        together: Sequence[MeasuredRecord] = (),
    ) -> None:
        self._together = tuple(record for record in together if not _varies(record))
        self.has_low_fidelity = cell.model in CHEAPER
        self._cells = {False: cell, True: replace(cell, model=CHEAPER.get(cell.model, cell.model))}
        self._targets = dict(targets)
        self._resolutions = {False: usual, True: fine}
        self._compiled: OrderedDict[_Key, DrivenCell | None] = OrderedDict()
        self._records: dict[int, MeasuredRecord] = {}
        self._recent: OrderedDict[Any, Response | None] = OrderedDict()
        self.simulations = 0
        self.refused: dict[str, str] = {}

    def predict(self, requests: Sequence[Request]) -> list[Prediction | None]:
        """Simulate one after the other; see `Answering.predict`."""
        return [self._predict(request) for request in requests]

    def _predict(self, request: Request) -> Prediction | None:
        candidate, moments = request.candidate, request.moments
        present = tuple(effect for effect in request.effects if not _is_absent(effect, candidate))
        request = replace(request, effects=present)
        driven = self._driven(request)
        if driven is None:
            return None
        own = (*(candidate.get(name) for name in self._targets), *(effect.values(candidate) for effect in present))
        # Not the identity of the compiled cell: once it is let go, another may have the same.
        of = _key(request, request.measured_record)
        key = (of, repr(own), request.soc, request.offset, len(moments.time), float(np.sum(moments.time)))
        if key not in self._recent:
            self.simulations += 1
            self._recent[key] = driven.solve(candidate, moments.time, moments.current, request.soc, request.offset)
            while len(self._recent) > _RECENT:
                self._recent.popitem(last=False)
        curve = self._recent[key]
        if curve is None:
            return None
        return Prediction(moments.averaged(curve.voltage), moments.averaged(curve.temperature))

    def _driven(self, request: Request) -> DrivenCell | None:
        effects, measured_record = request.effects, request.measured_record
        # The record itself is kept, so that its identity stays its own.
        self._records[id(measured_record)] = measured_record
        key = _key(request, measured_record)
        if key in self._compiled:
            self._compiled.move_to_end(key)
            return self._compiled[key]
        group = self._group(measured_record)
        cells: list[DrivenCell] | list[None]
        try:
            first, *others = (one.record for one in group)
            resolution = self._resolution(measured_record, request.fine)
            cell = self._cells[request.low_fidelity]
            start = Start(temperature_k=measured_record.ambient_k, initial_temperature_k=measured_record.initial_k)
            driven = DrivenCell(cell, effects, first, self._targets, start, resolution, others=others)
            cells = [driven, *(driven.on_other(place) for place in range(len(others)))]
        except BsaError as error:
            if not effects and not request.low_fidelity:
                raise
            cells = [None] * len(group)
            if effects:
                self.refused[" + ".join(effect.key for effect in effects)] = error.message
        made = {_key(request, record): one for record, one in zip(group, cells, strict=True)}
        self._compiled |= made
        while len(self._compiled) > _KEPT:
            self._compiled.popitem(last=False)
        return made[key]

    def _group(self, measured_record: MeasuredRecord) -> list[MeasuredRecord]:
        """The records that one compiled model serves: at the same temperature, with the same tolerances.

        Their order is that of ``together``, whichever is asked for first: where a record stands in the joined current
        decides the last digits of its times, and with them of all that is simulated.
        """
        if not any(measured_record is one for one in self._together):
            return [measured_record]

        def like(one: MeasuredRecord) -> tuple[float | None, float | None, bool]:
            return one.ambient_k, one.initial_k, one.is_long

        return [one for one in self._together if like(one) == like(measured_record)]

    def _resolution(self, measured_record: MeasuredRecord, fine: bool) -> Resolution:
        chosen = self._resolutions[fine]
        return replace(chosen, rtol=min(chosen.rtol, _RTOL_OF_MANY_CYCLES)) if measured_record.is_long else chosen


def _key(request: Request, record: MeasuredRecord) -> _Key:
    return tuple(effect.key for effect in request.effects), id(record), request.fine, request.low_fidelity


def _varies(measured_record: MeasuredRecord) -> bool:
    """Whether a record's current varies all the time, for which the integrator has settings of its own."""
    return any(step.kind is StepKind.DRIVE for step in measured_record.record.steps)


def _is_absent(effect: Effect, candidate: Candidate) -> bool:
    """Whether an effect at its null leaves the very equations of the base model: no option stays behind."""
    part = part_of(effect)
    changes_form = part.options or part.model or part.points
    return not changes_form and effect.values(candidate)[effect.strength.name] == effect.strength.null
