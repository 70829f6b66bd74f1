"""Tables of measured cells that show means over the records of a cell, or fits beside each other."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from bsa.experiments.campaign.summary import grouped, mean_of, statistic
from bsa.experiments.campaign.text_tables import Entry, brief, markdown_table, table_of

from .results import Results

ROLES = ("fitted", "held out")
"""What a record is to its fit."""

_AIM_CELL, _AIM_RECORD, _AIM_MV, _AIM_K = "Panasonic 18650PF", "US06", 15.0, 1.5
"""The held-out record with an aim, and the aim: its voltage error in mV and its temperature error in K."""

_PAPER_MAPE = "3.46 % (charge 0.60, current 1.81, voltage 1.04)"
"""The paper's mean over its seven measured cells."""

Rows = list[dict[str, Any]]
"""Rows of a study."""


def of_role(rows: Rows, role: str) -> Rows:
    """The fitted records, or those that were held out."""
    return [row for row in rows if row["role"] == role]


def first_fits(results: Results) -> Rows:
    """The records of measured cells, without those of a second fit: its name has what differs behind a comma."""
    return [row for row in results.rows("real_cells") if "," not in row["cell"]]


def errors_of(rows: Rows) -> str:
    """Smallest, largest and median error of records in words."""
    whole, most = ([row[name] for row in rows] for name in ("rms_mv", "rms_99_mv"))
    return (
        f"{brief(min(whole))} to {brief(max(whole))} mV rms, median {brief(float(np.median(whole)))} "
        f"({brief(min(most))} to {brief(max(most))} over 99 % of the time)"
    )


def cell_by_cell(results: Results) -> str:
    """Mean errors of every cell, those of all records, and the aim that was set."""
    rows = results.rows("real_cells")
    lines = []
    for cell, own in grouped(rows, "cell").items():
        fitted, held_out = (statistic([row["rms_mv"] for row in of_role(own, role)]) for role in ROLES)
        most = mean_of(of_role(own, "held out"), "rms_99_mv")
        errors = [brief(held_out.mean), brief(most), brief(held_out.worst)]
        lines.append([cell, f"{fitted.count}", brief(fitted.mean), f"{held_out.count}", *errors])
    heads = ["cell", "fitted records", "fitted, mean rms / mV", "held-out records"]
    heads += ["held out, mean rms / mV", "held out, over 99 % of the time / mV", "held out, largest rms / mV"]
    told = [f"* {_counted(first_fits(results), role)}" for role in ROLES]
    return "\n\n".join([markdown_table(heads, lines), "\n".join([*told, *_second_fits(rows), *_aim(rows)])])


def _counted(rows: Rows, role: str) -> str:
    own = of_role(rows, role)
    return f"{len(own)} {role.replace(' ', '-')} records (without those of second fits): {errors_of(own)}."


def _second_fits(rows: Rows) -> list[str]:
    """What a second fit of a cell gains on the records that neither fit has seen."""
    lines = []
    cells = grouped(rows, "cell")
    for second in cells:
        first = second.partition(",")[0]
        if first == second or first not in cells:
            continue
        held_out = [
            {row["record"]: row["rms_mv"] for row in of_role(cells[cell], "held out")} for cell in (first, second)
        ]
        shared = [record for record in held_out[0] if record in held_out[1]]
        means = [brief(float(np.mean([errors[record] for record in shared]))) for errors in held_out]
        better = sum(held_out[1][record] < held_out[0][record] for record in shared)
        lines.append(
            f"* {second}: of the {len(shared)} records held out of both fits, {better} are predicted better than by "
            f"the first fit; their mean is {means[1]} mV rms in place of {means[0]}."
        )
    return lines


def _aim(rows: Rows) -> list[str]:
    """The aim beside what was reached."""

    def verdict(value: float, limit: float) -> str:
        return "met" if value <= limit else "**missed**"

    return [
        f"* Aim for the held-out drive cycle {_AIM_RECORD} of the {_AIM_CELL}: {_AIM_MV:.0f} mV rms and {_AIM_K} K. "
        f"Reached: {brief(row['rms_mv'])} mV ({verdict(row['rms_mv'], _AIM_MV)}) and {brief(row['rms_k'])} K "
        f"({verdict(row['rms_k'], _AIM_K)})."
        for row in rows
        if row["cell"] == _AIM_CELL and _AIM_RECORD in row["record"]
    ]


@dataclass(frozen=True)
class TwoWays:
    """Mean errors of the records of each cell, fitted in one way and in another."""

    study: str
    columns: tuple[str, str]  # What the columns of the two ways begin with, before ``_mv`` and ``_99_mv``.

    def __call__(self, results: Results) -> str:
        """The table in Markdown."""
        kinds = {
            "fitted / mV": ("fitted", "_mv"),
            "held out / mV": ("held out", "_mv"),
            "held out, over 99 % / mV": ("held out", "_99_mv"),
        }
        lines = []
        for cell, own in grouped(results.rows(self.study), "cell").items():
            counts = " + ".join(f"{len(of_role(own, role))}" for role in ROLES)
            first, second = (
                [mean_of(of_role(own, role), f"{name}{end}") for role, end in kinds.values()] for name in self.columns
            )
            lines.append([cell, counts, *map(_arrow, first, second)])
        return results.framed(self.study, markdown_table(["cell", "records", *kinds], lines, 2))


def _arrow(first: float, second: float, form: Callable[[float], str] = brief) -> str:
    """Two values of one quantity; nothing where there are none."""
    return "" if math.isnan(first) and math.isnan(second) else f"{form(first)} → {form(second)}"


def led(results: Results) -> str:
    """Fits of cells without a low-fidelity model, and fits that it led."""
    by_cell = {
        cell: {row["led"]: row for row in own}
        for cell, own in grouped(results.rows("low_fidelity_cells"), "cell").items()
    }
    pairs = {cell: (fits["none"], fits["coarse DFN"]) for cell, fits in by_cell.items() if "coarse DFN" in fits}
    columns = {"simulations": "simulations", "time / s": "simulator_s"}
    errors = {"fitted / mV": "fitted_mv", "held out / mV": "held_out_mv"}
    lines = []
    for cell, (old, new) in pairs.items():
        counts = [_arrow(old[name], new[name], "{:.0f}".format) for name in columns.values()]
        means = [_arrow(old[name], new[name]) for name in errors.values()]
        lines.append([cell, *counts, *means, f"{new['low_fidelity_simulations']:.0f}"])
    shares = [[new[name] / old[name] for old, new in pairs.values()] for name in columns.values()]
    simulations, time = (f"{brief(min(share))} to {brief(max(share))}" for share in shares)
    told = [f"* With it, a fit takes {simulations} times the simulations of the full DFN, and {time} times the time."]
    others = [cell for cell in by_cell if cell not in pairs]
    told += [f"* Not run with the coarse DFN: {'; '.join(others)}."] if others else []
    table = markdown_table(["cell", *columns, *errors, "by the coarse DFN"], lines)
    return results.framed("low_fidelity_cells", table, "\n".join(told))


def nearest_set(results: Results) -> str:
    """Errors of single fast records, calibrated from a set that was named and from the nearest."""
    measures = {"before / mV": "start_mv", "rms / mV": "rms_mv", "over 99 % of the time / mV": "rms_99_mv"}
    lines = []
    for record, own in grouped(results.rows("nearest_set"), "record").items():
        named, nearest = ({row["parameters"]: row for row in own}[way] for way in ("Chen2020", "nearest"))
        taken = nearest["taken"].replace(" and ", ", ")
        lines.append([record, taken, *(_arrow(named[name], nearest[name]) for name in measures.values())])
    return results.framed("nearest_set", markdown_table(["record", "taken by `nearest`", *measures], lines, 2))


def nearest_potentials(results: Results) -> str:
    """Which published potentials are nearest to records that are not slow."""
    rows = results.rows("nearest_potentials")
    lines = [
        [
            f"{cell} ({chemistry})",
            ", ".join(f"{row['hours']:.1f}" for row in own),
            ", ".join(f"{row['rms_mv']:.1f}" for row in own),
            ", ".join(f"{row['other_mv']:.1f} ({row['other']})" for row in own),
        ]
        for (cell, chemistry), own in grouped(rows, "cell", "chemistry").items()
    ]
    heads = ["cell", "record / hours", "nearest: misfit / mV", "next other chemistry: misfit / mV"]
    right = sum(row["taken"] == row["chemistry"] for row in rows)
    words = f"* The positive electrode that is taken has the cell's own chemistry for {right} of {len(rows)} records."
    return results.framed("nearest_potentials", markdown_table(heads, lines), words)


def impedance(results: Results) -> str:
    """Mean errors of records and of impedance spectra, fitted with spectra and without."""
    fits = grouped(results.rows("impedance"), "fit")
    columns = {f"voltage rms, {role} / mV": (role, "rms_mv") for role in ROLES}
    columns |= {
        f"{part}, {role} / mohm": (role, f"{part}_mohm") for role in ROLES for part in ("resistance", "reactance")
    }
    columns |= {
        "ohmic, held out / mohm": (ROLES[1], "ohmic_mohm"),
        "measured / mohm": (ROLES[1], "measured_ohmic_mohm"),
    }
    means = {
        head: [mean_of(of_role(own, role), name) for own in fits.values()] for head, (role, name) in columns.items()
    }
    shown = {head: values for head, values in means.items() if not np.isnan(values).all()}
    lines = [[fit, *(brief(values[place]) for values in shown.values())] for place, fit in enumerate(fits)]
    return results.framed("impedance", markdown_table(["fit", *shown], lines))


def paper_cells(results: Results) -> str:
    """The paper's errors of first cycles whose steps are simulated."""
    rows = results.rows("paper_cells")
    columns: dict[str, Entry] = {
        "cell": "{cell}",
        "before / %": "{start_mape:brief}",
        "total MAPE / %": "{mape:brief}",
        "charge / %": "{q_mape:brief}",
        "current / %": "{i_mape:brief}",
        "voltage / %": "{v_mape:brief}",
        "voltage rms / mV": "{v_rmse_mv:brief}",
        "simulations": "{simulations:.0f}",
        "failed": "{failed:.0f}",
    }
    words = (
        f"* Mean total MAPE of the {len(rows)} cells: {brief(mean_of(rows, 'mape'))} %; the paper's, of seven cells: "
        f"{_PAPER_MAPE}."
    )
    return results.framed("paper_cells", table_of(rows, columns), words)
