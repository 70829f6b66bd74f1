"""Making a folder of blind cases: what a stop or a failure leaves does not stand in the way of the next command."""

from pathlib import Path
from typing import Any

import pytest
from bsa.core.errors import BsaError
from bsa.core.files import write_json, write_text
from bsa.experiments.discovery_bench.making import DESCRIPTION, make_cases, unseal


def made(folder: Path, seed: int, number: int, attempt: int) -> dict[str, Any]:
    write_json(folder / DESCRIPTION, {"records": []})
    return {"seed": seed, "number": number}


def stopped(folder: Path, seed: int, number: int, attempt: int) -> dict[str, Any]:
    write_text(folder / "record_1.csv", "half a case")
    raise KeyboardInterrupt


def test_a_first_case_that_was_stopped_is_made_by_the_same_command(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        make_cases(tmp_path / "blind", stopped, 2, seed=3)
    assert [path.name for path in make_cases(tmp_path / "blind", made, 2, seed=3)] == ["case_001", "case_002"]
    assert unseal(tmp_path / "blind")["case_002"] == {"seed": 3, "number": 1}


def test_another_seed_may_be_tried_where_none_was_made(tmp_path: Path) -> None:
    def failing(folder: Path, *drawn: int) -> dict[str, Any]:
        write_text(folder / "record_1.csv", "half a case")
        raise BsaError("it cannot be cut into steps.")

    with pytest.raises(BsaError, match="another --seed may do"):
        make_cases(tmp_path / "blind", failing, 1, seed=3)
    make_cases(tmp_path / "blind", made, 1, seed=4)
    assert unseal(tmp_path / "blind")["case_001"]["seed"] == 4
    with pytest.raises(BsaError, match="cases of seed 4, not 5"):
        make_cases(tmp_path / "blind", made, 2, seed=5)


def test_a_case_that_cannot_be_written_is_not_drawn_again(tmp_path: Path) -> None:
    """Else the seed would have another case on a disk that was full for a moment."""
    drawn = []

    def on_a_full_disk(folder: Path, seed: int, number: int, attempt: int) -> dict[str, Any]:
        drawn.append(attempt)
        (folder / "record_1.csv").mkdir(parents=True)
        write_text(folder / "record_1.csv", "a record")
        return {}

    with pytest.raises(BsaError, match=r"record_1\.csv cannot be used"):
        make_cases(tmp_path / "blind", on_a_full_disk, 1)
    assert drawn == [0]


def test_a_folder_of_other_things_is_refused(tmp_path: Path) -> None:
    write_text(tmp_path / "thesis.tex", "chapter")
    with pytest.raises(BsaError, match="not a folder of blind cases"):
        make_cases(tmp_path, made, 1)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]
