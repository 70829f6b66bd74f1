"""Tables of measured cells that show means over the records of a cell, or fits beside each other."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from bsa.experiments.campaign.summary import grouped, mean_of, statistic
from bsa.experiments.campaign.text_tables import Entry, brief, markdown_table, span, table_of

from .results import Results

ROLES = ("fitted", "held out")
"""What a record is to its fit."""

_AIMS: tuple[tuple[str, str, dict[str, float]], ...] = (
    ("CALCE CS2_35", "CS2_35", {"rms_mv": 8.0, "rms_99_mv": 4.0}),
    ("LG M50", "0p1C_25degC", {"rms_mv": 12.0}),
    ("LG M50", "0p5C_25degC", {"rms_mv": 12.0}),
    ("LG M50", "2C_25degC", {"rms_mv": 20.0, "rms_k": 3.0}),
    ("LG M50", "T25/cRate_1C", {"rms_mv": 20.0}),
    ("Panasonic 18650PF", "US06", {"rms_mv": 15.0, "rms_k": 1.5}),
    ("NMC pouch", "1C", {"rms_mv": 15.0}),
    ("NASA B0005", "B0005_discharges.csv.gz", {"rms_mv": 8.0}),
)
"""The aims: a cell, a part of a record's name, and limits of its errors."""

_QUANTITIES = {"rms_mv": "rms", "rms_99_mv": "rms over 99 % of the time", "rms_k": "temperature"}
"""What the limits are of; those in K are named so."""

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
    median = brief(float(np.median(whole)))
    return f"{span(whole)} mV rms, median {median} ({span(most)} over 99 % of the time)"


def _counts(rows: Rows) -> str:
    """How many records were fitted and how many held out."""
    return "+".join(f"{len(of_role(rows, role))}" for role in ROLES)


def cell_by_cell(results: Results) -> str:
    """Mean errors of every cell, those of all records, and the aims that were set."""
    rows = results.rows("real_cells")
    lines = []
    for cell, own in grouped(rows, "cell").items():
        fitted, held_out = (statistic([row["rms_mv"] for row in of_role(own, role)]) for role in ROLES)
        lines.append([cell, _counts(own), *map(brief, (fitted.mean, held_out.mean, held_out.worst))])
    heads = ["cell", "records", "fitted, mean / mV", "held out, mean / mV", "held out, largest / mV"]
    records = {role: of_role(first_fits(results), role) for role in ROLES}
    told = [f"* {len(own)} records {role}, without second fits: {errors_of(own)}." for role, own in records.items()]
    return "\n\n".join([markdown_table(heads, lines, 2), "\n".join([*told, *_second_fits(rows)]), _aims(rows)])


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
            f"* {second}: {better} of the {len(shared)} records held out of both fits gain; their mean goes "
            f"from {means[0]} to {means[1]} mV rms."
        )
    return lines


def _aims(rows: Rows) -> str:
    """The aims beside what was reached."""
    lines = []
    for cell, part, limits in _AIMS:
        for row in (row for row in rows if row["cell"] == cell and part in row["record"]):
            for name, limit in limits.items():
                unit = "K" if name.endswith("_k") else "mV"
                verdict = "met" if row[name] <= limit else "**missed**"
                reached = f"{brief(row[name])} {unit}"
                lines.append(
                    [cell, row["record"], row["role"], _QUANTITIES[name], f"{limit:g} {unit}", reached, verdict]
                )
            break
    return markdown_table(["aims", "record", "", "error", "aim", "reached", " "], lines, 4)


@dataclass(frozen=True)
class TwoWays:
    """Mean errors of the records of each cell, fitted in one way and in another."""

    study: str
    columns: tuple[str, str]
    most: tuple[str, str] | None = None  # Errors over 99 % of the time, where they are shown too.

    def __call__(self, results: Results) -> str:
        """The table in Markdown."""
        shown = {" / mV": self.columns} | ({" over 99 % of the time / mV": self.most} if self.most else {})
        lines = []
        for cell, own in grouped(results.rows(self.study), "cell").items():
            line = [cell, _counts(own)]
            for pair in shown.values():
                first, second = ([mean_of(of_role(own, role), name) for role in ROLES] for name in pair)
                line += map(_arrow, first, second)
            lines.append(line)
        heads = ["cell", "records", *(f"{role}{unit}" for unit in shown for role in ROLES)]
        return results.framed(self.study, markdown_table(heads, lines, 2))


def _arrow(first: float, second: float) -> str:
    """Two values of one quantity; nothing where there are none."""
    return "" if math.isnan(first) and math.isnan(second) else f"{brief(first)} → {brief(second)}"


def led(results: Results) -> str:
    """What a low-fidelity model that leads changes, over the cells that were fitted with it and without."""
    fits = {
        cell: {row["led"]: row for row in own}
        for cell, own in grouped(results.rows("low_fidelity_cells"), "cell").items()
    }
    pairs = {cell: (own["none"], own["coarse DFN"]) for cell, own in fits.items() if "coarse DFN" in own}

    def share(name: str) -> str:
        return span([new[name] / old[name] for old, new in pairs.values()])

    def change(name: str) -> str:
        changes = [new[name] - old[name] for old, new in pairs.values()]
        return f"{min(changes):+.1f} to {max(changes):+.1f} mV"

    told = [
        f"* Over {len(pairs)} cells, a fit takes {share('simulations')} times the simulations of the full DFN, and "
        f"{share('simulator_s')} times the time.",
        f"* A cell's mean error changes by {change('fitted_mv')} (fitted records) and by {change('held_out_mv')} "
        "(held out).",
    ]
    others = [cell for cell in fits if cell not in pairs]
    told += [f"* Not run with the coarse DFN: {'; '.join(others)}."] if others else []
    return results.framed("low_fidelity_cells", "\n".join(told))


def nearest_set(results: Results) -> str:
    """Errors of single fast records, calibrated from a set that was named and from the nearest."""
    lines = []
    for record, own in grouped(results.rows("nearest_set"), "record").items():
        named, nearest = ({row["parameters"]: row for row in own}[way] for way in ("Chen2020", "nearest"))
        lines.append([record, nearest["taken"].replace(" and ", ", "), _arrow(named["rms_mv"], nearest["rms_mv"])])
    return results.framed("nearest_set", markdown_table(["record", "taken by `nearest`", "rms / mV"], lines, 2))


def nearest_potentials(results: Results) -> str:
    """How well records that are not slow tell the chemistry by published potentials."""
    rows = results.rows("nearest_potentials")
    right = sum(row["taken"] == row["chemistry"] for row in rows)
    found = [row["rms_mv"] for row in rows]
    lead = {f"{row['cell']}, {row['hours']:.1f} h": row["other_mv"] - row["rms_mv"] for row in rows}
    least = min(lead, key=lambda record: lead[record])
    words = (
        f"* For {right} of {len(rows)} records the positive electrode that is taken has the cell's own chemistry. The "
        f"nearest pair leaves {span(found)} mV, that of the next chemistry {span([*lead.values()])} mV more "
        f"(least: {least})."
    )
    return results.framed("nearest_potentials", words)


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
        "total MAPE / %": "{mape:brief}",
        "charge / %": "{q_mape:brief}",
        "current / %": "{i_mape:brief}",
        "voltage / %": "{v_mape:brief}",
    }
    words = (
        f"* Mean total MAPE of the {len(rows)} cells: {brief(mean_of(rows, 'mape'))} %; the paper's, of seven cells: "
        f"{_PAPER_MAPE}."
    )
    return results.framed("paper_cells", table_of(rows, columns), words)
