"""An exported cell overwrites nothing but an earlier export."""

import json
from pathlib import Path

import pytest
from bsa.core.errors import BsaError
from bsa.experiments.cli.export import export


@pytest.fixture(autouse=True)
def _exported(monkeypatch: pytest.MonkeyPatch) -> None:
    text = json.dumps({"Header": {"BPX": "1.1.0"}})
    monkeypatch.setattr("bsa.experiments.export_cell.exported", lambda run, to: (text, ()))


@pytest.mark.parametrize("content", ["time,voltage,current\n0,4,1\n", '{"event": "run"}\n{}\n', '{"Mass [kg]": 1}'])
def test_a_file_that_is_no_export_is_kept(content: str, tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_text(content)
    with pytest.raises(BsaError, match="is not an exported cell; nothing was written"):
        export(tmp_path, "bpx", path)
    assert path.read_text() == content


def test_an_export_is_written_anew(tmp_path: Path) -> None:
    for _ in range(2):
        export(tmp_path, "bpx")
    (made,) = tmp_path.iterdir()
    assert "BPX" in made.read_text()
