from pathlib import Path

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.reading.part_of_file import file_and_part
from bsa.core.reading.reading import read_record
from scipy.io import savemat


def test_a_test_is_named_behind_its_file(tmp_path: Path) -> None:
    assert file_and_part("rates.mat#T25/1C") == (Path("rates.mat"), "T25/1C")
    assert file_and_part("rates.mat") == (Path("rates.mat"), None)
    assert file_and_part("rates.mat#") == (Path("rates.mat#"), None)
    (tmp_path / "cell#7.csv").write_text("")
    assert file_and_part(tmp_path / "cell#7.csv") == (tmp_path / "cell#7.csv", None)


def test_each_record_may_be_another_test_of_one_file(tmp_path: Path) -> None:
    def test(amperes: float) -> dict[str, object]:
        return {"Time": np.arange(100.0), "Voltage": np.linspace(4.0, 3.6, 100), "Current": np.full(100, -amperes)}

    savemat(tmp_path / "rates.mat", {"T25": {"slow": test(1.0), "quick": test(2.0)}})
    for name, amperes in (("slow", 1.0), ("quick", 2.0)):
        assert read_record(f"{tmp_path}/rates.mat#T25/{name}").trajectory.current[50] == amperes
    with pytest.raises(BsaError, match="no test for"):
        read_record(tmp_path / "rates.mat#T25/other")
    with pytest.raises(BsaError, match=r"there is no file .*absent\.mat"):
        read_record(tmp_path / "absent.mat#T25/slow")


def test_a_sign_in_a_folders_name_is_none_of_the_parts(tmp_path: Path) -> None:
    (tmp_path / "lab #3").mkdir()
    book = tmp_path / "lab #3" / "book.xlsx"
    book.touch()
    assert file_and_part(f"{book}#Sheet #2") == (book, "Sheet #2")
    assert file_and_part(book) == (book, None)
