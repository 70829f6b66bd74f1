"""Two runs that begin at once have two folders."""

from pathlib import Path

import pytest
from bsa.core.errors import BsaError
from bsa.experiments import run_names
from bsa.experiments.run_names import numbered_folder, reserved_folder


def test_a_reserved_folder_is_given_to_nobody_else(tmp_path: Path) -> None:
    with (
        reserved_folder(tmp_path / "runs", "my cell") as first,
        reserved_folder(tmp_path / "runs", "my cell") as second,
    ):
        assert [first.name, second.name] == ["my-cell-1", "my-cell-2"]
        (second / "journal.jsonl").write_text("")
    assert not first.exists()
    assert second.is_dir()


def test_a_folder_that_another_process_makes_meanwhile_is_left_to_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Path] = []

    def too_late(parent: Path, name: str) -> Path:
        asked.append(numbered_folder(parent, name))
        if len(asked) == 1:
            asked[0].mkdir()
        return asked[-1]

    monkeypatch.setattr(run_names, "numbered_folder", too_late)
    with reserved_folder(tmp_path, "demo") as folder:
        assert folder.name == "demo-2"
    assert (tmp_path / "demo-1").is_dir()


def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    (tmp_path / "runs").write_text("")
    with pytest.raises(BsaError, match="runs cannot be used"), reserved_folder(tmp_path / "runs", "demo"):
        pass
