"""The tables of measured cells: what was fitted, and what was not."""

from .plain import Plain


def _by_cell(study: str, head: str, entry: str) -> Plain:
    """Voltage errors of records by cell, with a further column before the simulations."""
    columns = {
        "cell": "{cell}",
        "record": "{record}",
        "": "{role}",
        "before / mV": "{start_mv:known}",
        "rms / mV": "{rms_mv:brief}",
        "over 99 % of the time / mV": "{rms_99_mv:brief}",
        head: entry,
        "simulations": "{simulations:.0f}",
    }
    return Plain(study, 3, columns)


TABLES = {
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
    # Voltage errors of the same fits, by whether a knee counts by all of its error.
    "knees": Plain(
        "knees",
        3,
        {
            "cell": "{cell}",
            "record": "{record}",
            "": "{role}",
            "rms by default / mV": "{usual_mv:brief}",
            "rms with knee / mV": "{rms_mv:brief}",
            "over 99 % of the time by default / mV": "{usual_99_mv:brief}",
            "with knee / mV": "{rms_99_mv:brief}",
        },
    ),
    # Which published potentials are nearest to records that are not slow.
    "nearest-potentials": Plain(
        "nearest_potentials",
        6,
        {
            "cell": "{cell}",
            "record": "{record}",
            "chemistry": "{chemistry}",
            "nearest (negative, positive)": "{negative}, {positive}",
            "its chemistry": "{taken}",
            "next other chemistry": "{other}",
            "hours": "{hours:.1f}",
            "nearest, rms / mV": "{rms_mv:.1f}",
            "next, rms / mV": "{other_mv:.1f}",
        },
    ),
    # Errors of single fast records, calibrated from a set that was named first and from the nearest.
    "nearest-set": Plain(
        "nearest_set",
        3,
        {
            "record": "{record}",
            "`--parameters`": "{parameters}",
            "taken": "{taken}",
            "before / mV": "{start_mv:known}",
            "rms / mV": "{rms_mv:brief}",
            "over 99 % of the time / mV": "{rms_99_mv:brief}",
            "simulations": "{simulations:.0f}",
        },
    ),
    # Voltage errors of the same fits, by whether records have a state of charge each or share a rest voltage.
    "starts": Plain(
        "starts",
        3,
        {
            "cell": "{cell}",
            "record": "{record}",
            "": "{role}",
            "rms with own states / mV": "{own_mv:brief}",
            "rms with shared corrections / mV": "{shared_mv:brief}",
            "over 99 % of the time with own states / mV": "{own_99_mv:brief}",
            "with shared corrections / mV": "{shared_99_mv:brief}",
        },
    ),
    # Errors of held-out records beside the bands that their fits predict.
    "bands": Plain(
        "bands",
        2,
        {
            "cell": "{cell}",
            "record": "{record}",
            "rms / mV": "{rms_mv:brief}",
            "half of the band, median / mV": "{band_mv:brief}",
            "of it from the misfit / mV": "{misfit_mv:brief}",
            "inside / %": "{inside_pct:known}",
            "simulations of the analysis": "{analysis_simulations:.0f}",
            "noise raised": "{widened:brief}",
        },
    ),
    # The paper's errors of first cycles whose steps are simulated.
    "paper-cells": Plain(
        "paper_cells",
        1,
        {
            "cell": "{cell}",
            "before / %": "{start_mape:brief}",
            "total MAPE / %": "{mape:brief}",
            "Q / %": "{q_mape:brief}",
            "I / %": "{i_mape:brief}",
            "V / %": "{v_mape:brief}",
            "voltage rms / mV": "{v_rmse_mv:brief}",
            "simulations": "{simulations:.0f}",
            "failed": "{failed:.0f}",
        },
    ),
    # Errors of records and of impedance spectra, fitted with spectra and without.
    "impedance": Plain(
        "impedance",
        3,
        {
            "fit": "{fit}",
            "record": "{record}",
            "": "{role}",
            "voltage rms / mV": "{rms_mv:known}",
            "resistance rms / mohm": "{resistance_mohm:known}",
            "reactance rms / mohm": "{reactance_mohm:known}",
            "ohmic / mohm": "{ohmic_mohm:known}",
            "measured ohmic / mohm": "{measured_ohmic_mohm:known}",
        },
    ),
    # Simulations, their time and errors of fits of cells with and without the low-fidelity model.
    "low-fidelity-cells": Plain(
        "low_fidelity_cells",
        3,
        {
            "cell": "{cell}",
            "low-fidelity model": "{led}",
            "version": "{version}",
            "simulations": "{simulations:.0f}",
            "by the low-fidelity model": "{low_fidelity_simulations:.0f}",
            "time of all / s": "{simulator_s:.0f}",
            "fitted: mean rms / mV": "{fitted_mv:known}",
            "held out: mean rms / mV": "{held_out_mv:known}",
        },
    ),
    # Errors of cells whose records have rests in place of a slow charge or discharge.
    "pulse-tests": _by_cell("pulse_tests", "inside / %", "{inside_pct:known}"),
    # Errors on cells of other packages' tests, which no version had seen.
    "one-record": Plain(
        "one_record",
        3,
        {
            "cell": "{cell}",
            "fitted": "{fitted}",
            "held out": "{held_out}",
            "fitted by hybrid / mV": "{hybrid_mv:brief}",
            "by staged / mV": "{staged_mv:brief}",
            "held out, hybrid / mV": "{hybrid_held_mv:brief}",
            "staged / mV": "{staged_held_mv:brief}",
            "largest correction of a potential, hybrid / mV": "{hybrid_correction_mv:.0f}",
            "staged, largest / mV": "{staged_correction_mv:.0f}",
        },
    ),
    "unseen-cells": _by_cell("unseen_cells", "temperature rms / K", "{rms_k:known}"),
}
