"""The tables of measured cells: what was fitted, and what was not."""

from __future__ import annotations

import math

from ..campaign.text_tables import markdown_table
from .layout import short
from .results import Results

_OF_SPECTRA = ("resistance_mohm", "reactance_mohm", "ohmic_mohm", "measured_ohmic_mohm")


def fitted_and_held_out(results: Results) -> str:
    """Voltage errors of every record."""
    lines = [
        [
            row["cell"],
            row["record"],
            row["role"],
            short(row["start_mv"]),
            short(row["rms_mv"]),
            short(row["rms_99_mv"]),
            short(row["max_mv"]),
            short(row["rms_k"]),
            f"{row['simulations']:.0f}",
            row["failure"] if isinstance(row["failure"], str) else "",
        ]
        for row in results.rows("real_cells")
    ]
    heads = [
        "cell",
        "record",
        "",
        "before / mV",
        "rms / mV",
        "over 99 % of the time / mV",
        "largest / mV",
        "temperature rms / K",
        "simulations",
        "ended early",
    ]
    return results.framed("real_cells", markdown_table(heads, lines, 3))


def as_in_the_paper(results: Results) -> str:
    """The paper's errors of first cycles whose steps are simulated."""
    keys = ("start_mape", "mape", "q_mape", "i_mape", "v_mape", "v_rmse_mv")
    lines = [
        [row["cell"], *(short(row[key]) for key in keys), f"{row['simulations']:.0f}", f"{row['failed']:.0f}"]
        for row in results.rows("paper_cells")
    ]
    heads = [
        "cell",
        "before / %",
        "total MAPE / %",
        "Q / %",
        "I / %",
        "V / %",
        "voltage rms / mV",
        "simulations",
        "failed",
    ]
    return results.framed("paper_cells", markdown_table(heads, lines, 1))


def with_spectra(results: Results) -> str:
    """Errors of records and of impedance spectra, fitted with spectra and without."""
    lines = [
        [
            row["fit"],
            row["record"],
            row["role"],
            "" if math.isnan(row["rms_mv"]) else short(row["rms_mv"]),
            *("" if math.isnan(row[key]) else short(row[key]) for key in _OF_SPECTRA),
        ]
        for row in results.rows("impedance")
    ]
    heads = [
        "fit",
        "record",
        "",
        "voltage rms / mV",
        "resistance rms / mohm",
        "reactance rms / mohm",
        "ohmic / mohm",
        "measured ohmic / mohm",
    ]
    return results.framed("impedance", markdown_table(heads, lines, 3))
