"""The tables of measured cells: what was fitted, and what was not."""

from collections.abc import Mapping

from bsa.experiments.campaign.text_tables import table_of

from .results import Results


def fitted_and_held_out(results: Results) -> str:
    """Voltage errors of every record."""
    columns = {
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
    }
    return results.framed("real_cells", table_of(results.rows("real_cells"), columns, 3))


def by_weight(results: Results) -> str:
    """Voltage errors of the same fits, by whether a knee counts by all of its error."""
    columns = {
        "cell": "{cell}",
        "record": "{record}",
        "": "{role}",
        "rms by default / mV": "{usual_mv:brief}",
        "rms with knee / mV": "{rms_mv:brief}",
        "over 99 % of the time by default / mV": "{usual_99_mv:brief}",
        "with knee / mV": "{rms_99_mv:brief}",
    }
    return results.framed("knees", table_of(results.rows("knees"), columns, 3))


def by_potentials(results: Results) -> str:
    """Which published potentials are nearest to records that are not slow."""
    columns = {
        "cell": "{cell}",
        "record": "{record}",
        "chemistry": "{chemistry}",
        "nearest (negative, positive)": "{negative}, {positive}",
        "its chemistry": "{taken}",
        "next other chemistry": "{other}",
        "hours": "{hours:.1f}",
        "nearest, rms / mV": "{rms_mv:.1f}",
        "next, rms / mV": "{other_mv:.1f}",
    }
    return results.framed("nearest_potentials", table_of(results.rows("nearest_potentials"), columns, 6))


def by_start(results: Results) -> str:
    """Errors of single fast records, calibrated from a set that was named first and from the nearest."""
    columns = {
        "record": "{record}",
        "`--parameters`": "{parameters}",
        "taken": "{taken}",
        "before / mV": "{start_mv:known}",
        "rms / mV": "{rms_mv:brief}",
        "over 99 % of the time / mV": "{rms_99_mv:brief}",
        "simulations": "{simulations:.0f}",
    }
    return results.framed("nearest_set", table_of(results.rows("nearest_set"), columns, 3))


def by_initial_state(results: Results) -> str:
    """Voltage errors of the same fits, by whether records have a state of charge each or share a rest voltage."""
    columns = {
        "cell": "{cell}",
        "record": "{record}",
        "": "{role}",
        "rms with own states / mV": "{own_mv:brief}",
        "rms with shared corrections / mV": "{shared_mv:brief}",
        "over 99 % of the time with own states / mV": "{own_99_mv:brief}",
        "with shared corrections / mV": "{shared_99_mv:brief}",
    }
    return results.framed("starts", table_of(results.rows("starts"), columns, 3))


def by_rests(results: Results) -> str:
    """Errors of cells whose records have rests in place of a slow charge or discharge."""
    return _fitted_and_held_out(results, "pulse_tests", {"inside / %": "{inside_pct:known}"})


def unseen(results: Results) -> str:
    """Errors on cells of other packages' tests, which no version had seen."""
    return _fitted_and_held_out(results, "unseen_cells", {"temperature rms / K": "{rms_k:known}"})


def _fitted_and_held_out(results: Results, name: str, further: Mapping[str, str]) -> str:
    """Voltage errors of records by cell, with further columns before the simulations."""
    columns = {
        "cell": "{cell}",
        "record": "{record}",
        "": "{role}",
        "before / mV": "{start_mv:known}",
        "rms / mV": "{rms_mv:brief}",
        "over 99 % of the time / mV": "{rms_99_mv:brief}",
        **further,
        "simulations": "{simulations:.0f}",
    }
    return results.framed(name, table_of(results.rows(name), columns, 3))


def by_band(results: Results) -> str:
    """Errors of held-out records beside the bands that their fits predict."""
    columns = {
        "cell": "{cell}",
        "record": "{record}",
        "rms / mV": "{rms_mv:brief}",
        "half of the band, median / mV": "{band_mv:brief}",
        "of it from the misfit / mV": "{misfit_mv:brief}",
        "inside / %": "{inside_pct:known}",
        "simulations of the analysis": "{analysis_simulations:.0f}",
        "noise raised": "{widened:brief}",
    }
    return results.framed("bands", table_of(results.rows("bands"), columns, 2))


def as_in_the_paper(results: Results) -> str:
    """The paper's errors of first cycles whose steps are simulated."""
    columns = {
        "cell": "{cell}",
        "before / %": "{start_mape:brief}",
        "total MAPE / %": "{mape:brief}",
        "Q / %": "{q_mape:brief}",
        "I / %": "{i_mape:brief}",
        "V / %": "{v_mape:brief}",
        "voltage rms / mV": "{v_rmse_mv:brief}",
        "simulations": "{simulations:.0f}",
        "failed": "{failed:.0f}",
    }
    return results.framed("paper_cells", table_of(results.rows("paper_cells"), columns))


def with_spectra(results: Results) -> str:
    """Errors of records and of impedance spectra, fitted with spectra and without."""
    columns = {
        "fit": "{fit}",
        "record": "{record}",
        "": "{role}",
        "voltage rms / mV": "{rms_mv:known}",
        "resistance rms / mohm": "{resistance_mohm:known}",
        "reactance rms / mohm": "{reactance_mohm:known}",
        "ohmic / mohm": "{ohmic_mohm:known}",
        "measured ohmic / mohm": "{measured_ohmic_mohm:known}",
    }
    return results.framed("impedance", table_of(results.rows("impedance"), columns, 3))


def led_and_alone(results: Results) -> str:
    """Simulations, their time and errors of fits of cells with and without the low-fidelity model."""
    columns = {
        "cell": "{cell}",
        "low-fidelity model": "{led}",
        "version": "{version}",
        "simulations": "{simulations:.0f}",
        "by the low-fidelity model": "{low_fidelity_simulations:.0f}",
        "time of all / s": "{simulator_s:.0f}",
        "fitted: mean rms / mV": "{fitted_mv:known}",
        "held out: mean rms / mV": "{held_out_mv:known}",
    }
    return results.framed("low_fidelity_cells", table_of(results.rows("low_fidelity_cells"), columns, 3))


def by_jacobian(results: Results) -> str:
    """Time of a few simulations without and with the full rows of the Jacobian apart."""
    columns = {
        "full rows of the Jacobian": "{rows}",
        "version": "{version}",
        "simulations": "{simulations:.0f}",
        "processor s": "{processor_s:.0f}",
    }
    return results.framed("jacobian", table_of(results.rows("jacobian"), columns, 3))
