"""Names and paths of the cell that an assistant chooses."""

from pathlib import Path

import pytest
from bsa.core.errors import BsaError
from bsa.experiments.mcp_server.arguments import Cell
from bsa.experiments.mcp_server.folders import Folders


@pytest.mark.parametrize("search", ["cell", "silicon-cell"])
def test_every_preset_can_be_named(search: str, tmp_path: Path) -> None:
    assert Cell(search=search).given(Folders([tmp_path])) == {"search": search}


@pytest.mark.parametrize("search", ["other.yaml", "../other", "folder/other"])
def test_a_file_of_parameters_is_refused(search: str, tmp_path: Path) -> None:
    with pytest.raises(BsaError, match="is no preset"):
        Cell(search=search).given(Folders([tmp_path]))


def test_a_run_in_the_first_folder_is_a_parameter_set_and_a_folder_of_records_is_none(tmp_path: Path) -> None:
    for name in ("earlier", "Chen2020"):
        (tmp_path / name).mkdir()
    (tmp_path / "earlier" / "journal.jsonl").write_text("{}")
    folders = Folders([tmp_path])
    assert Cell(parameters="earlier").given(folders) == {"parameters": str(tmp_path / "earlier")}
    assert Cell(parameters="Chen2020").given(folders) == {"parameters": "Chen2020"}
