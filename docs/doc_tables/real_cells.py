"""The tables of measured cells: what was fitted, and what was not."""

from collections.abc import Callable

from . import by_cell
from .plain import Plain
from .results import Results

TABLES: dict[str, Callable[[Results], str]] = {
    "cell-by-cell": by_cell.cell_by_cell,
    # Voltage errors of every record.
    "real-cells": Plain(
        "real_cells",
        3,
        {
            "cell": "{cell}",
            "record": "{record}",
            "": "{role}",
            "before / mV": "{start_mv:brief}",
            "rms / mV": "{rms_mv:brief}",
            "over 99 % of the time / mV": "{rms_99_mv:brief}",
            "largest / mV": "{max_mv:brief}",
            "temperature rms / K": "{rms_k:brief}",
            "simulations": "{simulations:.0f}",
            "ended early": "{failure}",
        },
    ),
    # Errors of one cell's fit, without and with potentials that a slow curve has corrected.
    "corrected-potentials": Plain(
        "corrected_potentials",
        2,
        {
            "record": "{record}",
            "": "{role}",
            "rms / mV": "{without_mv:brief} → {rms_mv:brief}",
            "over 99 % of the time / mV": "{without_99_mv:brief} → {rms_99_mv:brief}",
        },
    ),
    # Mean voltage errors of the same fits, by whether a knee counts by all of its error.
    "knees": by_cell.TwoWays("knees", ("usual_mv", "rms_mv")),
    "nearest-potentials": by_cell.nearest_potentials,
    "nearest-set": by_cell.nearest_set,
    # Mean voltage errors of the same fits, without and with a part of the negative electrode that exchanges slowly.
    "slow-material": by_cell.TwoWays("slow_material", ("without_mv", "with_mv"), ("without_99_mv", "with_99_mv")),
    # Mean voltage errors of the same fits, by whether records have a state of charge each or share a rest voltage.
    "starts": by_cell.TwoWays("starts", ("own_mv", "shared_mv")),
    # Errors of held-out records beside the bands that their fits predict.
    "bands": Plain(
        "bands",
        2,
        {
            "cell": "{cell}",
            "record": "{record}",
            "rms / mV": "{rms_mv:brief}",
            "half of the band, median / mV": "{band_mv:brief}",
            "inside / %": "{inside_pct:known}",
        },
    ),
    "paper-cells": by_cell.paper_cells,
    "impedance": by_cell.impedance,
    "low-fidelity-cells": by_cell.led,
    # Errors of single records, fitted by two scaffolds.
    "one-record": Plain(
        "one_record",
        3,
        {
            "cell": "{cell}",
            "fitted record": "{fitted}",
            "held-out record": "{held_out}",
            "fitted / mV": "{hybrid_mv:brief} → {staged_mv:brief}",
            "held out / mV": "{hybrid_held_mv:brief} → {staged_held_mv:brief}",
            "largest correction / mV": "{hybrid_correction_mv:.0f} → {staged_correction_mv:.0f}",
            "−2 ln posterior density": "{hybrid_improbability:.0f} → {staged_improbability:.0f}",
        },
    ),
    # Errors on cells of other packages, which no version had seen.
    "unseen-cells": Plain(
        "unseen_cells",
        3,
        {
            "cell": "{cell}",
            "record": "{record}",
            "": "{role}",
            "rms / mV": "{rms_mv:brief}",
            "over 99 % of the time / mV": "{rms_99_mv:brief}",
            "inside / %": "{inside_pct:known}",
        },
    ),
}
