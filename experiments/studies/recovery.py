"""``bsa bench recovery``: whether a good fit finds the true parameters, and holds on other protocols."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from ...core.comparison.paper_metrics import evaluate
from ...core.files import write_csv, write_text
from ...core.parameters import Candidate, ParameterSpace
from ...core.simulation import Outcome
from ...core.task import Task
from ..campaign.store import Store
from ..campaign.summary import Row, grouped, mean_of
from ..campaign.text_tables import brief, markdown_table
from ..run_record import RunRecord, read_run
from ..suite.case import SuiteCase
from ..suite.target import cell_of, experiment_of, reference_run
from .grids import with_results

HELD_OUT_RATES = (0.2, 1.0, 2.0)
_NOISE = 0.05
_TIED = 1e-12
_ERRORS = ("mape", "v_mape", "v_rmse_mv")

_QUALITIES = {
    "5 % noise": "true, with 5 % noise on each",
    "recovered": "recovered by the fit",
    "default": "of the base cell",
}
"""The parameters with which rates that were not fitted are simulated, in words."""


@dataclass(frozen=True)
class Recovered:
    """A finished cell with the truth that it was to find."""

    row: Row  # Of the results table.
    case: SuiteCase  # What was fitted.
    run: RunRecord  # Its journal.

    @property
    def truth(self) -> Candidate:
        """The true values of all that was searched."""
        space = self.run.task.space
        return {**space.initial, **{name: value for name, value in self.case.hidden.items() if name in space}}

    @property
    def name(self) -> dict[str, Any]:
        """The columns that say which cell it is."""
        return {"task": self.row["task"], "method": self.row["method"]}


def write_recovery(
    rows: Sequence[Row],
    store: Store,
    out: Path,
    cases: Mapping[str, SuiteCase],
    seed: int = 1234,
    say: Callable[[str], None] = print,
) -> None:
    """Compare what was found with the truth.

    Writes ``recovery.csv`` (within-case correlations), ``held_out.csv`` and ``recovery.md``. The seed is for the noise
    on the true parameters.
    """
    within: list[dict[str, Any]] = []
    held: list[dict[str, Any]] = []
    for row in with_results(rows):
        recovered = Recovered(row, cases[row["task"]], read_run(store.cell(row["identity"])))
        within.append(within_case(recovered))
        say(f"{row['task']} {row['method']}: held-out protocols ...")
        held += held_out_rows(recovered, seed)
    write_csv(out / "recovery.csv", within)
    write_csv(out / "held_out.csv", held)
    write_text(out / "recovery.md", "\n\n".join(_parts(within, held)) + "\n")


def _parts(within: Sequence[Row], held: Sequence[Row]) -> Iterator[str]:
    """The tables and remarks of each method."""
    of_method = grouped(held, "method")
    for method, rows in grouped(within, "method").items():
        table, remarks = recovery_table(rows, of_method.get(method, []))
        yield from (f"{method}:", table, "\n".join(remarks))


def recovery_table(rows: Sequence[Row], held: Sequence[Row]) -> tuple[str, list[str]]:
    """What one method recovered: a table of errors at rates that were not fitted, and remarks."""
    rates = sorted({row["rate"] for row in held})
    mean = {
        quality: [
            mean_of([row for row in held if (row["quality"], row["rate"]) == (quality, rate)], "mape") for rate in rates
        ]
        for quality in _QUALITIES
    }
    lines = [[words, *(f"{brief(value)} %" for value in mean[quality])] for quality, words in _QUALITIES.items()]
    heads = [f"parameters of {len(rows)} tasks, mean MAPE at", *(f"{rate:g}C" for rate in rates)]
    ratios = [
        noisy / found if found else math.inf for noisy, found in zip(mean["5 % noise"], mean["recovered"], strict=True)
    ]
    means = {name: mean_of(rows, name) for name in ("pearson", "spearman", "share_of_steps_that_co_decrease")}
    median = float(np.median([row["median_relative_error"] for row in rows]))
    largest = max(row["largest_relative_error"] for row in rows)
    remarks = []
    if ratios:
        remarks.append(
            f"* What was recovered predicts rates that were not fitted {min(ratios):.0f} to {max(ratios):.0f} times "
            "better than the truth known to 5 %."
        )
    remarks += [
        f"* A parameter's own error: median {median:.1%} (of the cases' medians), largest {largest:.0%}.",
        f"* Within a case, over its successive best trials, errors of curve and parameters correlate with Pearson "
        f"{means['pearson']:.2f} and Spearman {means['spearman']:.2f}; they fall together in "
        f"{means['share_of_steps_that_co_decrease']:.0%} of the steps (means of the cases; the paper reports 0.963 and "
        "1.000).",
    ]
    return markdown_table(heads, lines), remarks


def parameter_error(space: ParameterSpace, candidate: Candidate, truth: Candidate) -> float:
    """Root mean square distance of two candidates in the unit box: 0.1 is a tenth of every range."""
    return float(np.sqrt(np.mean((space.to_unit(candidate) - space.to_unit(truth)) ** 2)))


def within_case(cell: Recovered) -> dict[str, Any]:
    """How trajectory error and parameter error go together, along the incumbents and over all trials.

    Correlations are NaN where fewer than three points, or no spread, allow none.
    """
    space, truth, found = cell.run.task.space, cell.truth, cell.run.best.candidate
    done = [trial for trial in cell.run.trials if trial.ok and trial.metrics is not None]
    errors = np.array([trial.objective for trial in done], dtype=np.float64)
    distances = np.array([parameter_error(space, trial.candidate, truth) for trial in done])
    # The incumbents: each trial that was better than all before it, the paper's "as the agent progresses".
    best_before = np.concatenate([[np.inf], np.minimum.accumulate(errors)[:-1]])
    incumbent = errors < best_before
    falls = np.diff(distances[incumbent]) <= _TIED
    relative = [abs(found[name] - true) / abs(true) for name, true in truth.items() if abs(true) > 0]
    return {
        **cell.name,
        "mape": cell.row["mape"],
        "pearson": _correlation(stats.pearsonr, errors[incumbent], distances[incumbent]),
        "spearman": _correlation(stats.spearmanr, errors[incumbent], distances[incumbent]),
        "pearson_all_trials": _correlation(stats.pearsonr, np.log10(errors + 1e-6), distances),
        "spearman_all_trials": _correlation(stats.spearmanr, errors, distances),
        "incumbents": int(incumbent.sum()),
        "monotonic": bool(falls.all()) if falls.size else math.nan,
        "share_of_steps_that_co_decrease": float(falls.mean()) if falls.size else math.nan,
        "first_parameter_error": float(distances[0]) if distances.size else math.nan,
        "last_parameter_error": parameter_error(space, found, truth),
        "median_relative_error": float(np.median(relative)),
        "largest_relative_error": float(np.max(relative)),
    }


def _correlation(measure: Any, one: Any, other: Any) -> float:
    if len(one) < 3 or np.ptp(one) == 0.0 or np.ptp(other) == 0.0:
        return math.nan
    return float(measure(one, other).statistic)


def held_out_rows(recovered: Recovered, seed: int) -> list[dict[str, Any]]:
    """Errors of four parameter sets at rates that were not fitted, against the true cell.

    Charge and discharge run at the same rate. The four: the truth, the truth with 5 % noise on every
    parameter, what was recovered, and the base cell.
    """
    case, space, truth = recovered.case, recovered.run.task.space, recovered.truth
    rng = np.random.default_rng([seed, *case.key.encode()])
    noisy = {name: value * (1.0 + _NOISE * rng.standard_normal()) for name, value in truth.items()}
    candidates = {
        "perfect": truth,
        "5 % noise": space.project(noisy),
        "recovered": recovered.run.best.candidate,
        "default": space.initial,
    }
    cell = cell_of(case)
    rows: list[dict[str, Any]] = []
    for rate in HELD_OUT_RATES:
        experiment = experiment_of(replace(case, charge_rate=rate, discharge_rate=rate))
        target = reference_run(cell, experiment, truth)
        if target.failure is not None or target.trajectory is None:
            continue
        task = Task("held-out", cell, space, (replace(experiment, target=target.trajectory),))
        for quality, candidate in candidates.items():
            run = reference_run(cell, experiment, candidate)
            metrics = evaluate(task, Outcome((run,))) if run.failure is None else None
            rows.append(
                {
                    **recovered.name,
                    "rate": rate,
                    "quality": quality,
                    **{name: None if metrics is None else getattr(metrics, name) for name in _ERRORS},
                }
            )
    return rows
