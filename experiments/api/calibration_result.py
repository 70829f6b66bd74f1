"""What ``bsa.calibrate`` returns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...core.errors import BsaError, did_you_mean
from ...core.files import load_json
from ...core.metrics import errors_of, headline_of
from ...core.printable import counted
from ..report.page import FILE_NAME as REPORT
from ..report.search_misfit import search_misfits
from ..report.wording import number, quantity
from ..run_record import RunRecord, read_run
from .measured import READING, Data, records_of
from .notebook import picture_of, render
from .scripts import namespace_of

if TYPE_CHECKING:
    import pybamm

    from .prediction_result import PredictionResult


@dataclass(frozen=True, eq=False)
class CalibrationResult:
    """A calibration as it stands in its folder; a notebook shows it as tables and curves.

    Attributes
    ----------
    folder : Path
        Journal, results and report.
    """

    folder: Path
    _run: RunRecord = field(repr=False)

    @classmethod
    def of(cls, folder: str | Path) -> CalibrationResult:
        """The calibration in a folder, of this session or an earlier one.

        Raises
        ------
        BsaError
            If the folder holds none, or not even its first simulation finished.
        """
        return cls(Path(folder), read_run(Path(folder)))

    @property
    def status(self) -> str:
        """Why it ended: ``"converged"``, ``"simulations-spent"``, ``"interrupted"``, ..."""
        return self._run.status

    @property
    def notes(self) -> tuple[str, ...]:
        """What was assumed, repaired or worth saying."""
        return self._run.notes

    @property
    def parameters(self) -> dict[str, float]:
        """The calibrated values by PyBaMM's names, in PyBaMM's units."""
        return dict(self._run.best.candidate)

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """95 % intervals by name, cut at the bounds; empty where the run did not look."""
        analysis = self._run.analysis
        found = {} if analysis is None else analysis.identifiability.intervals
        return {name: (interval.lower, interval.upper) for name, interval in found.items()}

    @property
    def errors(self) -> dict[str, dict[str, float | None]]:
        """``"initial"`` and ``"best"`` error by name and unit, ``"Voltage RMSE [mV]"``."""
        run = self._run
        found = {one: (one.shown(run.initial_metrics), one.shown(run.best_metrics)) for one in errors_of(run.task)}
        return {
            f"{quantity.label} [{quantity.unit}]": {"initial": initial, "best": best}
            for quantity, (initial, best) in {**found, **search_misfits(run.task, run.initial, run.best)}.items()
        }

    @property
    def report(self) -> Path:
        """The report, one self-contained page."""
        return self.folder / REPORT

    @property
    def parameter_values(self) -> pybamm.ParameterValues:
        """The calibrated parameter set, ready to use; at temperature and initial state of the first record.

        Its nominal capacity is that of the cell's size, and its cut-offs are those of the set.
        """
        from ...plugins.pybamm.cells.nameplate import labelled

        return labelled(self._script["parameter_values"](), self._run.task.cell)

    @property
    def model(self) -> pybamm.BaseBatteryModel:
        """A new model of the kind that was calibrated, with its options."""
        return self._script["model"]()

    @cached_property
    def _script(self) -> dict[str, Any]:
        from ...plugins.pybamm.export.calibrated_script import script

        task, simulator = self._run.task, self._run.simulator
        if simulator != "pybamm":
            raise BsaError(
                f'task "{task.name}" is simulated by {simulator}, not by PyBaMM.',
                ".parameters has the calibrated values.",
            )
        return namespace_of(script(task, self._run.best.candidate), "best_parameters")

    @property
    def record_errors(self) -> dict[str, dict[str, dict[str, float | str]]]:
        """Errors by record and signal, held-out records included; empty where the run did not come to score them."""
        found = (*self._run.records, *(prediction.errors for prediction in self._run.held_out))
        return {one.record: {name: asdict(error) for name, error in one.signals.items()} for one in found}

    def predict(
        self,
        data: Data | Sequence[Data],
        *,
        initial_soc: float | Sequence[float] | None = None,
        out: str | Path | None = None,
        band: bool = True,
        workers: int = 0,
        **options: Any,
    ) -> PredictionResult:
        """Score records that this run did not fit. What ``bsa predict`` does.

        Parameters
        ----------
        data : path, pandas.DataFrame, Record, or a sequence of these
            The records.
        initial_soc : float or sequence of float, optional
            State of charge at which all of them, or each, start; left out, where the fitted cell shows the first
            voltage.
        out : path, optional
            New or empty folder of the prediction; by default ``predictions/<record>-<n>`` in the run's.
        band : bool
            Whether what the fitted parameters leave open is simulated too, once for each draw of them.
        workers : int
            Simulations side by side; 0: as many as cores, 4 at most.
        **options
            How files and DataFrames are read; see `read_record` and, for numbers that differ by record, `calibrate`.

        Raises
        ------
        BsaError
            If the data cannot be read, or was fitted.
        """
        from ..checked_options import simulation_workers
        from ..predict import predicted
        from ..read_options import readings
        from .prediction_result import PredictionResult

        unknown = sorted(set(options) - set(READING))
        if unknown:
            raise BsaError(f'there is no option "{unknown[0]}" for reading.', did_you_mean(unknown[0], READING))
        records = records_of(data, None, readings(**options), initial_soc)
        place = None if out is None else Path(out)
        scored, page = predicted(self.folder, records, place, simulation_workers(workers), band=band)
        return PredictionResult(page.parent, page, scored)

    def to_json(self) -> dict[str, Any]:
        """The contents of ``result.json``: plain dicts, lists, strings and numbers.

        Raises
        ------
        BsaError
            If the file is gone or damaged.
        """
        content: dict[str, Any] = load_json(self.folder / "result.json", "calibrate(resume=FOLDER) writes it again.")
        return content

    def __repr__(self) -> str:
        shown = (
            f"{one.words} {number(one.shown(self._run.initial_metrics))} → "
            f"{number(one.shown(self._run.best_metrics))} {one.unit}"
            for one in headline_of(self._run.task)
        )
        return f"<CalibrationResult {self._run.task.name}: {self.status}, {', '.join(shown)}; {self.report}>"

    def _repr_html_(self) -> str:
        run = self._run
        before, after, intervals = run.initial_metrics, run.best_metrics, self.intervals
        errors = {one: (one.shown(before), one.shown(after)) for one in headline_of(run.task)}
        errors |= search_misfits(run.task, run.initial, run.best)
        rows = []
        for parameter in run.task.space:
            name = parameter.name
            ends = [quantity(end, parameter.unit) for end in intervals.get(name, ())]
            best, initial = run.best.candidate[name], run.initial.candidate[name]
            rows.append((name, quantity(initial, parameter.unit), quantity(best, parameter.unit), " to ".join(ends)))
        return render(
            "calibration.html.j2",
            title=f"{run.task.name}: {self.status} after {counted(len(run.trials), 'simulation')}",
            errors=[(one.label, number(start), number(end), one.unit) for one, (start, end) in errors.items()],
            rows=rows,
            picture=picture_of(run),
            report=self.report,
        )
