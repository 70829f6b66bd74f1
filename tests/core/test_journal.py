from pathlib import Path

import pytest
from bsa.core.errors import BsaError
from bsa.core.journal import FILE_NAME, FORMAT, Journal, read_events


def test_events_come_back_in_order(tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    for number in range(3):
        journal.append("trial", number=number, text="Σ\n")
    journal.close()
    assert [event["number"] for event in read_events(tmp_path)] == [0, 1, 2]


@pytest.mark.parametrize("cut", [1, 5, 20])
def test_a_torn_last_line_is_dropped_with_a_warning(tmp_path: Path, cut: int) -> None:
    journal = Journal(tmp_path)
    journal.append("trial", number=0)
    journal.append("trial", number=1, filler="x" * 40)
    journal.close()
    path = tmp_path / FILE_NAME
    path.write_bytes(path.read_bytes()[:-cut])
    assert [event["number"] for event in read_events(tmp_path)] == [0]
    reopened = Journal(tmp_path)
    assert "torn last line" in reopened.warnings[0]
    reopened.append("trial", number=1)
    reopened.close()
    assert [event["number"] for event in read_events(tmp_path)] == [0, 1]


def test_two_writers_are_refused(tmp_path: Path) -> None:
    first = Journal(tmp_path)
    with pytest.raises(BsaError, match="another process is writing"):
        Journal(tmp_path)
    first.close()
    Journal(tmp_path).close()


def test_a_newer_format_is_refused(tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    journal.append("run", format=FORMAT + 1)
    journal.close()
    with pytest.raises(BsaError, match="upgrade"):
        list(read_events(tmp_path))


def test_damage_in_the_middle_is_told_with_its_line(tmp_path: Path) -> None:
    (tmp_path / FILE_NAME).write_text('{"event":"run","format":1}\n{broken\n{"event":"end"}\n')
    with pytest.raises(BsaError, match="damaged at line 2"):
        list(read_events(tmp_path))


def test_a_folder_without_a_run_is_told(tmp_path: Path) -> None:
    with pytest.raises(BsaError, match="holds no run"):
        list(read_events(tmp_path))
