"""What ``CalibrationResult.predict`` returns."""

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from ..predict import ScoredRecords
from ..report.figures import prediction_overlays
from ..report.records import error_rows
from .notebook import as_picture, render


@dataclass(frozen=True, eq=False)
class PredictionResult:
    """Records that a run did not fit, scored; a notebook shows a table and curves.

    Attributes
    ----------
    folder : Path
        ``prediction.json`` and the page.
    report : Path
        The page.
    """

    folder: Path
    report: Path
    _scored: ScoredRecords = field(repr=False)

    @property
    def errors(self) -> dict[str, dict[str, dict[str, float | str]]]:
        """By record and signal: ``unit``, ``rms``, ``max`` and ``rms_99``, the last over 99 % of the time."""
        return {
            one.errors.record: {name: asdict(error) for name, error in one.errors.signals.items()}
            for one in self._scored.run.held_out
        }

    @property
    def bands(self) -> dict[str, dict[str, dict[str, float]]]:
        """By record and signal: half the width of the 95 % band, ``rms`` and ``max``, and the share ``inside`` it."""
        return {
            one.errors.record: {name: asdict(band) for name, band in one.bands.items()}
            for one in self._scored.run.held_out
        }

    @property
    def notes(self) -> tuple[str, ...]:
        """What was assumed or repaired of the records, and what is worth noticing."""
        return self._scored.notes

    @property
    def spectra(self) -> dict[str, dict[str, Any]]:
        """By impedance spectrum: ohmic resistance and arcs, measured and simulated, and the error, in mohm."""
        predicted = [one.errors for one in self._scored.run.held_out]
        return {errors.record: asdict(errors.impedance) for errors in predicted if errors.impedance is not None}

    def to_json(self) -> dict[str, Any]:
        """The contents of ``prediction.json``: plain dicts, lists, strings and numbers."""
        return self._scored.to_json()

    def __repr__(self) -> str:
        rows = error_rows(self._scored.run.task, (), self._scored.run.held_out)
        return f"<PredictionResult {'; '.join([*(row.line for row in rows), *self.notes])}; {self.report}>"

    def _repr_html_(self) -> str:
        task = self._scored.run.task
        return render(
            "prediction.html.j2",
            rows=error_rows(task, self._scored.run.records, self._scored.run.held_out),
            pictures=[
                (overlay.name, as_picture(overlay.chart))
                for overlay in prediction_overlays(task, self._scored.run.held_out)
            ],
            report=self.report,
        )
