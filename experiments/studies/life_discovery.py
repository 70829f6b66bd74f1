"""``bsa bench life-discovery``: lives with one hidden mechanism, and a measured one.

The hidden lives are PyBaMM's own experiments, made without anything of the search, with 1 mV of noise; the measured
one is that of CALCE's cell CS2_35. Each is asked as ``bsa discover --life`` asks.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...core.discovery.findings import Findings
from ...core.discovery.life import DEVIATION_V
from ...core.discovery.life_discovery import LifeDiscovery
from ...core.files import replacing
from ...plugins.pybamm.cells.parameter_sets import pybamm
from ..campaign.summary import Row, grouped
from ..campaign.text_tables import Entry, brief, markdown_table, table_of
from ..discover import discover
from ..discovery_case import discover_options
from ..processor_time import processor_s
from ..read_options import reading
from ..task_request import Records
from .whole_life import record_of

CYCLE = (
    "Charge at 1C until 4.2 V",
    "Hold at 4.2 V until C/20",
    "Rest for 5 minutes",
    "Discharge at 1C until 2.5 V",
    "Rest for 5 minutes",
)
SET, MODEL, CYCLES, FITTED = "Chen2020", "SPM", 200, 120
_START, _NOISE_V = 0.2, 1e-3
_USUAL_CRACKING = 3.9e-20
"""OKane2022's cracking rate of graphite at 25 °C."""

_MEASURED_SET, _MEASURED_CYCLES, _MEASURED_FITTED = "Ai2020", 500, 300

MEASURED = ("CS2_35",)


@dataclass(frozen=True)
class Hidden:
    """A mechanism that a life was made with."""

    name: str  # As the catalogue calls it.
    options: Mapping[str, Any]  # PyBaMM's model options.
    change: Callable[[Any], Mapping[str, Any]]  # Parameter values that it takes, from those at hand.
    ohm_per_cycle: float = 0.0  # By which a contact resistance grows.
    model: str = MODEL  # PyBaMM's, of the cell and of the search.


def _times(factor: float, name: str) -> Callable[[Any], Mapping[str, Any]]:
    """A change that multiplies a parameter, number or function."""

    def change(values: Any) -> dict[str, Any]:
        usual = values[name]
        return {name: (lambda *arguments: factor * usual(*arguments)) if callable(usual) else factor * usual}

    return change


HIDDEN = {
    "diffusion": Hidden(
        "sei-growth", {"SEI": "solvent-diffusion limited"}, _times(40, "SEI solvent diffusivity [m2.s-1]")
    ),
    "reaction": Hidden(
        "sei-growth", {"SEI": "reaction limited"}, _times(3, "SEI reaction exchange current density [A.m-2]")
    ),
    "plating": Hidden(
        "lithium-plating",
        {"lithium plating": "irreversible"},
        _times(0.015, "Exchange-current density for plating [A.m-2]"),
    ),
    "material": Hidden(
        "loss-of-active-material",
        {"loss of active material": ("stress-driven", "none"), "particle mechanics": "swelling only"},
        _times(20, "Negative electrode LAM constant proportional term [s-1]"),
    ),
    "resistance": Hidden("resistance-growth", {"contact resistance": "true"}, lambda values: {}, 1e-4),
    "electrons": Hidden(
        "sei-growth", {"SEI": "electron-migration limited"}, _times(60, "SEI electron conductivity [S.m-1]")
    ),
    "interstitials": Hidden(
        "sei-growth",
        {"SEI": "interstitial-diffusion limited"},
        _times(2000, "SEI lithium interstitial diffusivity [m2.s-1]"),
    ),
    "cracks": Hidden(
        "sei-growth",
        {
            "SEI": "solvent-diffusion limited",
            "SEI on cracks": "true",
            "particle mechanics": ("swelling and cracking", "none"),
        },
        lambda values: {
            "SEI solvent diffusivity [m2.s-1]": 10 * values["SEI solvent diffusivity [m2.s-1]"],
            "Negative electrode cracking rate": _USUAL_CRACKING * 100,
        },
        model="DFN",
    ),
}


def make(hidden: Hidden, path: Path, seed: int, cycles: int = CYCLES) -> None:
    """Simulate a life by PyBaMM's own experiment, and write it as a cycler would; whole or not at all."""
    values = pybamm.ParameterValues(SET)
    # What the set lacks of ageing, from one that was made for it.
    others = pybamm.ParameterValues("OKane2022")
    values.update({name: others[name] for name in others if name not in values}, check_already_exists=False)
    values.update(dict(hidden.change(values)))
    values.update({"Contact resistance [Ohm]": "[input]"}, check_already_exists=False)
    experiment = pybamm.Experiment([CYCLE], period="30 seconds")
    model = getattr(pybamm.lithium_ion, hidden.model)(dict(hidden.options))
    simulation = pybamm.Simulation(model, parameter_values=values, experiment=experiment)
    rng = np.random.default_rng(seed)
    solution = None
    with replacing(path) as file:
        file.write(b"time_s,current_A,voltage_V\n")
        for number in range(cycles):
            start = {"initial_soc": _START} if solution is None else {"starting_solution": solution}
            inputs = {"Contact resistance [Ohm]": hidden.ohm_per_cycle * number}
            cycle = simulation.solve(inputs=inputs, **start).cycles[-1]
            time_s, current, voltage = (cycle[name].entries for name in ("Time [s]", "Current [A]", "Voltage [V]"))
            noisy = voltage + rng.normal(0.0, _NOISE_V, len(voltage))
            np.savetxt(file, np.column_stack([time_s, -current, noisy]), "%.8g", ",")
            solution = cycle.last_state
            solution.termination = "final time"


def items(data: Path | None) -> dict[str, dict[str, Any]]:
    """What is asked of each life; without a folder of records no measured one."""
    measured = {} if data is None else {case: {"case": case, "record": record_of(case, data)} for case in MEASURED}
    return {**{case: {"case": case} for case in HIDDEN}, **measured}


def ask(folder: Path, case: str, record: Path | None = None) -> dict[str, Any]:
    """Make a life, or take a measured one, and ask which mechanism ages it."""
    if record is None:
        path = folder / f"{case}.csv"
        if not path.is_file():  # of a time before, which was stopped
            make(HIDDEN[case], path, list(HIDDEN).index(case))
        columns = {"time": "time_s", "current": "current_A", "voltage": "voltage_V"}
        records = Records([path], reads=[reading(columns, temperature=25.0)], fit_cycles=FITTED)
        base = SET
    else:
        cycles = f"1-{_MEASURED_CYCLES}"
        records = Records([record], reads=[reading(cycles=cycles)], fit_cycles=_MEASURED_FITTED)
        base = _MEASURED_SET
    began = processor_s()
    # No model comes down to the noise of a measured cell, so that no pair would count.
    most, model = (2, HIDDEN[case].model) if case in HIDDEN else (1, MODEL)
    found = discover(discover_options(records, folder / "found", parameters=base, model=model, max_effects=most))
    assert isinstance(found, LifeDiscovery)
    modes = [
        {
            "task": case,
            "quantity": mode.name,
            # At the last cycle: its value, and half the 95 % interval of that.
            "cycle": mode.cycles[-1],
            "value": mode.values[-1],
            "half": mode.half[-1],
            "per_100_cycles": mode.per_100_cycles,
            "half_per_100_cycles": mode.half_per_100_cycles,
        }
        for mode in found.modes
        if mode.cycles
    ]
    row = row_of(case, found.findings, processor_s() - began)
    return {"rows": [row], "life_modes": modes, "summary": f"{row['verdict']} {row['named']}".rstrip()}


def row_of(case: str, found: Findings, seconds: float) -> dict[str, Any]:
    """What was found in a life, as a row; ``seconds`` of processor time include the fit of the first cycle."""
    named = " + ".join(found.best.names) if found.verdict in ("effect-found", "ambiguous") else ""
    rivals = ", ".join(sorted({" + ".join(rival.names) for rival in found.rivals}))
    return {
        "task": case,
        "hidden": HIDDEN[case].name if case in HIDDEN else "",
        "verdict": found.verdict,
        "named": named,
        "rivals": rivals,
        # Of the cell without ageing and of the best mechanism, in the fitted cycles and in the later ones.
        "base_error": found.base.rmse_v / DEVIATION_V,
        "error": found.best.rmse_v / DEVIATION_V,
        "base_later_error": found.base.held_rmse_v / DEVIATION_V,
        "later_error": found.best.held_rmse_v / DEVIATION_V,
        "best": found.best.label,
        "reason": found.reason,
        "processor_s": seconds,
    }


def mechanisms_table(rows: Sequence[Row]) -> str:
    """Which mechanism was found in each life, and how many were named rightly."""
    columns: dict[str, Entry] = {
        "life": "{task}",
        "hidden": lambda row: _text(row["hidden"], "not known"),
        "verdict": "{verdict}",
        "named": lambda row: _text(row["named"], "none") + _text(row["rivals"], "", " or {}"),
        "nearest": "{best}",
        "fitted cycles": "{base_error:.1f} → {error:.1f}",
        "later cycles": "{base_later_error:.1f} → {later_error:.1f}",
        "processor s": "{processor_s:.0f}",
    }
    known = [row for row in rows if _text(row["hidden"], "")]
    right = sum(row["verdict"] == "effect-found" and row["named"] == row["hidden"] for row in known)
    wrong = sum(row["verdict"] == "effect-found" and row["named"] != row["hidden"] for row in known)
    remark = (
        f"* {right} of {len(known)} hidden mechanisms named alone, {wrong} wrong names. Errors: standard deviations."
    )
    return "\n\n".join([table_of(rows, columns), remark])


def _text(field: object, empty: str, form: str = "{}") -> str:
    """A field in some words; others where it is empty, which a table that was read has as NaN."""
    return form.format(field) if isinstance(field, str) and field else empty


def modes_table(rows: Sequence[Row]) -> str:
    """What the same lives lost of lithium, active material and conductance by the cycle beside their names."""
    quantities = list(dict.fromkeys(row["quantity"] for row in rows))
    found = {(row["task"], row["quantity"]): f"{brief(row['value'])} ± {brief(row['half'])}" for row in rows}
    lines = [
        [f"{life} ({own[0]['cycle']:.0f})", *(found.get((life, quantity), "–") for quantity in quantities)]
        for life, own in grouped(rows, "task").items()
    ]
    return markdown_table(["life (cycle)", *quantities], lines)
