"""The calibrated cell as a Python script that needs pybamm alone."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ....core.cell import FREQUENCY
from ....core.effect import Effect
from ....core.parameters import Candidate
from ....core.printable import shown
from ....core.protocol_text import runs_of
from ....core.target import CellChange
from ....core.task import CellModel, Experiment, ParameterFile, Task
from ..augmentation import augmented_cell, effects_in, part_of
from ..cells.model_options import as_built
from ..cells.ocp_shape import BUMP_WIDTH, by_curve
from ..cells.parameter_files import as_json
from ..cells.parameter_sets import FILL_FROM, as_simulated, bake, load, pybamm
from ..cells.state_of_charge import InitialState, changed_values
from ..modelling import drive
from ..modelling.compiled_cell import added_potentials, start_of
from ..modelling.resolution import REFERENCE
from ..solving import compiled, driven_cell
from ..solving.spectrum_experiment import DOUBLE_LAYERS
from .quoted_effects import quoted

_BRACKETS = {dict: ("{", "}"), list: ("[", "]"), tuple: ("(", ")")}
_LINE = 80

_BEYOND_S = 60.0
"""How far the table of a current goes on behind its end, s."""


def script(
    task: Task, candidate: Candidate, effects: Sequence[Effect] = (), file_name: str = "best_parameters.py"
) -> str:
    """Python source that simulates a candidate as the final score does, without this package.

    A script that runs by itself, and a module that offers ``parameter_values()``, ``model()`` and ``simulate()``; it
    will be called ``file_name``. Names and protocol strings come from files and models: they enter as literals only,
    never as code or comments. ``effects`` are those beside the cell's own; ``candidate`` has a value for every searched
    parameter and for the parameters of all effects.
    """
    effects = (*effects_in(task.cell), *effects)
    change = as_simulated(task.cell, task.space.change(candidate))
    cell = augmented_cell(task.cell, effects)
    from_file = isinstance(task.cell.parameter_set, ParameterFile)
    tables: dict[str, str] = {}
    return filled(
        "best_parameters.py.j2",
        literal,
        pybamm_version=pybamm.__version__,
        fill_from=FILL_FROM,
        parameter_set=str(task.cell.parameter_set),
        embedded=parameter_values_json(task.cell, change) if from_file else "",
        file_name=file_name,
        model=cell.model,
        options=as_built(cell.options),
        effects=[quoted(number, effect, candidate) for number, effect in enumerate(effects, start=1)],
        points={name: count for effect in effects for name, count in part_of(effect).points.items()},
        overrides={} if from_file else {name: float(value) for name, value in task.cell.overrides.items()},
        calibrated=dict(change.values),
        factors={} if from_file else dict(change.factors),
        bumps={} if from_file else by_curve(change.ocp_shape),
        diffusivity_factors={} if from_file else by_curve(change.diffusivity_shape),
        bump_width=BUMP_WIDTH,
        records=[
            _record(
                task.cell, experiment, change, tables, _start_soc(task.cell, experiment, change, effects, candidate)
            )
            for experiment in task.experiments
        ],
        tables=tables,
        spectra=any(experiment.is_spectrum for experiment in task.experiments),
        double_layers=DOUBLE_LAYERS,
        resolution=REFERENCE.graded(),
        rtol=REFERENCE.rtol,
        atol=REFERENCE.atol,
        max_solver_steps=max(compiled.MAX_STEPS, driven_cell.MAX_STEPS),
        cut_offs=drive.WIDE_CUT_OFFS,
    )


def filled(template: str, as_literal: Callable[[Any], str], **content: Any) -> str:
    """A template of a script, filled in: every value stands in it as a literal, or in a comment of one line."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # the product is Python: every value goes through `as_literal` instead
    )
    environment.filters["literal"] = as_literal
    environment.filters["comment"] = lambda text: shown(text, 1000)
    return environment.get_template(template).render(**content)


def parameter_values_json(cell: CellModel, change: CellChange) -> str:
    """The changed cell's whole parameter set as JSON that ``pybamm.ParameterValues.from_json`` reads."""
    return as_json(changed_values(cell, change))


def literal(value: Any, indent: int = 0) -> str:
    """A value as a Python literal in ASCII, one entry a line where it does not fit on one.

    Non-printable and non-ASCII characters come out as escapes: a name must not disguise what the script does.
    """
    if isinstance(value, str):
        text = ascii(value)
        return f'"{value}"' if text == f"'{value}'" and '"' not in value else text
    if not isinstance(value, (dict, list, tuple)):
        return ascii(value)
    opening, closing = _BRACKETS[type(value)]
    deeper = indent + 4
    if isinstance(value, dict):
        entries = [f"{literal(key)}: {literal(entry, deeper)}" for key, entry in value.items()]
    else:
        entries = [literal(entry, deeper) for entry in value]
    line = ", ".join(entries) + "," * (isinstance(value, tuple) and len(value) == 1)
    if len(line) + indent <= _LINE and "\n" not in line:
        return f"{opening}{line}{closing}"
    return opening + "".join(f"\n{' ' * deeper}{entry}," for entry in entries) + f"\n{' ' * indent}{closing}"


def _start_soc(
    cell: CellModel, experiment: Experiment, change: CellChange, effects: Sequence[Effect], candidate: Candidate
) -> float | None:
    """The state of charge at which an experiment starts, as `CompiledCell` finds it; None leaves it to the set."""
    start = start_of(experiment)

    def soc_at(voltage: float) -> float:
        values = load(cell.parameter_set, cell.overrides)
        start.set_temperatures(values)
        return InitialState(values).soc_at(voltage, change, added_potentials(values, effects, candidate))

    return start.soc_of(change, soc_at)


def _record(
    cell: CellModel, experiment: Experiment, change: CellChange, tables: dict[str, str], soc: float | None
) -> dict[str, Any]:
    """How one experiment is simulated; current profiles go into ``tables``."""
    ambient_k, initial_k = experiment.temperature_k, experiment.initial_temperature_k
    content: dict[str, Any] = {
        "name": experiment.name,
        "temperature_k": None if ambient_k is None else float(ambient_k),
        **({} if initial_k is None else {"initial_temperature_k": float(initial_k)}),
        "initial_soc": None if soc is None else float(soc),
        "initial_concentrations": _initial_concentrations(cell, change, soc),
    }
    if experiment.is_spectrum:
        return {**content, "frequencies": [float(f"{hz:.6g}") for hz in experiment.target.values(FREQUENCY.name)]}
    if experiment.protocol is not None:
        return {**content, "protocol": [(count, list(cycle)) for count, cycle in runs_of(experiment.protocol)]}
    offset = change.current_offset.get(experiment.name, 0.0)
    pieces = [drive.offset_by(piece, offset) for piece in drive.pieces_of(experiment.target)]
    currents = [_current(piece, tables) for piece in pieces]
    return {**content, "currents": currents, "dt_max": _longest_solver_step(pieces)}


def _initial_concentrations(cell: CellModel, change: CellChange, soc: float | None) -> dict[str, float]:
    """As in `CompiledCell`: state of charge and lithium as concentrations, of the calibrated cell; empty without."""
    if soc is None and change.cyclable_lithium == 1.0:
        return {}
    values = load(cell.parameter_set, cell.overrides)
    bake(values, change)
    return InitialState(values).concentrations(CellChange(cyclable_lithium=change.cyclable_lithium), soc)


def _current(piece: drive.Piece, tables: dict[str, str]) -> tuple[float | str, float]:
    """Current in A, or the name of its table, and the duration in s."""
    if piece.constant:
        return float(piece.current[0]), piece.duration
    name = f"profile {len(tables) + 1}"
    # One more knot beyond the end, so that the integrator never extrapolates.
    knots = zip([*piece.time, piece.duration + _BEYOND_S], [*piece.current, piece.current[-1]], strict=True)
    tables[name] = "\n".join(f"{time:.9g} {current:.9g}" for time, current in knots)
    return name, piece.duration


def _longest_solver_step(pieces: Sequence[drive.Piece]) -> float | None:
    """The integrator must not step over what a drive cycle resolves."""
    spacing = [float(np.median(np.append(np.diff(one.time), _BEYOND_S))) for one in pieces if not one.constant]
    return max(60.0, 20.0 * max(spacing)) if spacing else None
