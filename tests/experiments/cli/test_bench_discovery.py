"""Tables of blind cases: those of one set of results do not take the place of another's."""

from pathlib import Path

from bsa.experiments.cli.main import app
from bsa.experiments.discovery_bench import grading, tables
from typer.testing import CliRunner


def test_every_set_of_results_has_a_table_of_its_own(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(grading, "grade_cases", lambda folder, results: [results])
    monkeypatch.setattr(grading, "graded_row", lambda case: {"case": case})
    for table in ("as_markdown", "case_table"):
        monkeypatch.setattr(tables, table, str)
    for more in ([], ["--results", "with-model"]):
        called = CliRunner().invoke(app(), ["bench", "discovery", "score", str(tmp_path), *more])
        assert called.exit_code == 0, called.output
    found = {path.name: path.read_text().split() for path in tmp_path.iterdir()}
    assert found == {"cases.csv": ["case", "discovery"], "cases-with-model.csv": ["case", "with-model"]}
