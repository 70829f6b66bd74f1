"""No path that an assistant names leads out of the server's folders."""

from pathlib import Path

import pytest
from bsa.core.errors import BsaError
from bsa.experiments.mcp_server.folders import Folders


@pytest.fixture
def folders(tmp_path: Path) -> Folders:
    for name in ("one", "two", "elsewhere"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "cell.csv").write_text("1")
    (tmp_path / "one" / "link.csv").symlink_to(tmp_path / "elsewhere" / "cell.csv")
    (tmp_path / "one" / "linked").symlink_to(tmp_path / "elsewhere")
    (tmp_path / "one" / "books").mkdir()
    (tmp_path / "one" / "books" / "a.xlsx").symlink_to(tmp_path / "elsewhere" / "cell.csv")
    return Folders([tmp_path / "one", tmp_path / "two"])


@pytest.mark.parametrize("name", ["cell.csv", "./cell.csv", "new/folder", "{tmp}/one/cell.csv", "{tmp}/two/cell.csv"])
def test_a_path_inside_is_taken(name: str, folders: Folders, tmp_path: Path) -> None:
    found = folders.inside(name.format(tmp=tmp_path))
    assert found.is_relative_to(tmp_path / "one") or found.is_relative_to(tmp_path / "two")


@pytest.mark.parametrize(
    "name",
    [
        "../elsewhere/cell.csv",
        "../one/cell.csv",
        "new/../cell.csv",
        "/etc/passwd",
        "{tmp}/elsewhere/cell.csv",
        "{tmp}/one/../elsewhere/cell.csv",
        "{tmp}/onefold/cell.csv",
        "link.csv",
        "linked/cell.csv",
        "linked/new",
        "books",
        "cell\0.csv",
        "~/cell.csv/../../x",
    ],
)
def test_a_path_that_leads_out_is_refused(name: str, folders: Folders, tmp_path: Path) -> None:
    with pytest.raises(BsaError) as raised:
        folders.inside(name.format(tmp=tmp_path))
    assert raised.value.hint.startswith("give a path inside ")


def test_a_folder_may_itself_be_reached_by_a_link(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "short").symlink_to(tmp_path / "data")
    assert Folders([tmp_path / "short"]).inside("cell.csv") == tmp_path / "data" / "cell.csv"


def test_a_folder_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BsaError, match="there is no folder"):
        Folders([tmp_path / "missing"])


def test_a_part_of_a_file_is_named_behind_it(folders: Folders, tmp_path: Path) -> None:
    assert folders.file("cell.csv#1C") == tmp_path / "one" / "cell.csv#1C"
    with pytest.raises(BsaError, match="symbolic link"):
        folders.file("link.csv#1C")
    with pytest.raises(BsaError, match="lies outside"):
        folders.file("cell.csv#../../elsewhere/cell.csv")
    with pytest.raises(BsaError, match="there is no file") as raised:
        folders.file("cel.csv#1C")
    assert "cell.csv" in raised.value.hint
