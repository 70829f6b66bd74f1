"""Parameters that were read already are kept for a discovery that goes on."""

from pathlib import Path

import pytest
from bsa.core.errors import BsaError
from bsa.core.task import ParameterFile
from bsa.experiments.discovery_case import discover_options
from bsa.experiments.task_request import Records


def test_loaded_parameters_are_the_same_when_a_discovery_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    records, folder = Records([tmp_path / "a.csv"]), tmp_path / "run"
    mine = ParameterFile("own", "values", '{"Radius of a 5 µm particle [m]": 5e-6}')
    first = discover_options(records, folder, parameters=mine)
    folder.mkdir()
    (folder / "journal.jsonl").write_text('{"event":"run"}\n')

    # The files are written in UTF-8, whatever the machine reads by default.
    read_text = Path.read_text
    monkeypatch.setattr(Path, "read_text", lambda path, encoding="ascii": read_text(path, encoding))
    assert discover_options(records, folder, parameters=mine) == first
    with pytest.raises(BsaError, match="a discovery with other parameters"):
        discover_options(records, folder, parameters=ParameterFile("own", "values", "{}"))
