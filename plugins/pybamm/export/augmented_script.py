"""The augmented model as a script that needs pybamm alone."""

import pprint
from collections.abc import Mapping, Sequence
from typing import Any

from ....core.contracts.requests import MeasuredRecord
from ....core.effect import Effect
from ....core.inference.observations import after_jumps
from ....core.parameters import Candidate
from ....core.printable import shown
from ....core.target import CellChange, Target, change_of
from ....core.task import CellModel, ParameterFile
from ....core.thinning import evenly
from ..augmentation import augmented_cell, effects_in
from ..cells.model_options import as_built
from ..cells.parameter_sets import FILL_FROM, load, pybamm
from ..cells.state_of_charge import InitialState, initial_concentration
from ..modelling.drive import current_function, offset_by
from ..modelling.resolution import Resolution
from ..solving.driven_cell import FINE
from .calibrated_script import filled, parameter_values_json
from .quoted_effects import quoted

_LONGEST = 4000
"""Samples of a record that the script carries at most."""


def augmented_script(
    cell: CellModel,
    effects: Sequence[Effect],
    candidate: Candidate,
    targets: Mapping[str, Target],
    measured_records: Sequence[MeasuredRecord],
    resolution: Resolution = FINE,
) -> str:
    """Source text of ``augmented_model.py``.

    The script runs without arguments: it simulates each of the fitted records, whose currents are written into it, and
    says how far it is from what was measured. ``targets`` are what the base parameters act on, by their names.
    ``resolution`` is that with which the discovery measured its discretisation, so that the script's curve is the
    report's.
    """
    effects = (*effects_in(cell), *effects)
    augmented = augmented_cell(cell, effects)
    state = InitialState(load(cell.parameter_set, cell.overrides))
    change = change_of(targets, candidate)
    records = []
    for one in measured_records:
        drive = offset_by(current_function(one.record), change.current_offset.get(one.name, 0.0))
        start = state.concentrations(change, change.soc_of(one.name))
        kept = evenly(len(one.record.time), _LONGEST)
        records.append(
            {
                "name": shown(one.name),
                "ambient_k": one.ambient_k,
                "initial_k": one.ambient_k if one.initial_k is None else one.initial_k,
                "negative": start[initial_concentration("Negative")],
                "positive": start[initial_concentration("Positive")],
                "time": [round(float(t), 4) for t in drive.time],
                "current": [round(float(i), 8) for i in drive.current],
                "stops": [round(float(t), 4) for t in drive.stops],
                "sample": [round(float(t), 4) for t in after_jumps(one.record)[kept]],
                "measured": [round(float(v), 5) for v in one.record.voltage[kept]],
            }
        )
    return filled(
        "augmented_model.py.j2",
        _literal,
        version=pybamm.__version__,
        fill_from=FILL_FROM,
        parameter_set=str(cell.parameter_set),
        embedded=parameter_values_json(cell, CellChange()) if isinstance(cell.parameter_set, ParameterFile) else "",
        model=augmented.model,
        options=as_built(augmented.options),
        overrides=dict(cell.overrides),
        factors=dict(change.factors),
        effects=[quoted(number, effect, candidate) for number, effect in enumerate(effects, start=1)],
        records=records,
        resolution=resolution,
    )


def _literal(value: Any) -> str:
    """A value as Python, in ASCII: a name must not disguise what the script does."""
    text = pprint.pformat(value, width=110, compact=True, sort_dicts=False)
    return text.encode("ascii", "backslashreplace").decode()
