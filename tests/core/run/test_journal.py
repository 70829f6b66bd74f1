import errno
import os
from pathlib import Path
from typing import Any

import pytest
from bsa.core.errors import BsaError
from bsa.core.run.journal import FILE_NAME, FORMAT, LOCK, Journal, check_run_folder, opened, read_events, spent_s


def test_events_come_back_in_order(tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    for number in range(3):
        journal.append("count", number=number, text="Σ\n")
    journal.close()
    assert [event["number"] for event in read_events(tmp_path)] == [0, 1, 2]


@pytest.mark.parametrize("cut", [1, 5, 20])
def test_a_torn_last_line_is_dropped_with_a_warning(tmp_path: Path, cut: int) -> None:
    journal = Journal(tmp_path)
    journal.append("run", number=0)
    journal.append("count", number=1, filler="x" * 40)
    journal.close()
    path = tmp_path / FILE_NAME
    path.write_bytes(path.read_bytes()[:-cut])
    assert [event["number"] for event in read_events(tmp_path)] == [0]
    reopened = Journal(tmp_path)
    assert "torn last line" in reopened.warnings[0]
    reopened.append("count", number=1)
    reopened.close()
    assert [event["number"] for event in read_events(tmp_path)] == [0, 1]


def test_two_writers_are_refused(tmp_path: Path) -> None:
    first = Journal(tmp_path)
    with pytest.raises(BsaError, match="another process is writing"):
        Journal(tmp_path)
    first.close()
    Journal(tmp_path).close()


@pytest.mark.parametrize("inner", [False, True])
def test_what_was_refused_leaves_nothing_but_a_run_of_its_own(tmp_path: Path, inner: bool) -> None:
    folder = tmp_path / "run"

    def refused() -> None:
        with opened(folder, "simulation") as journal:
            journal.file.append("run", format=FORMAT)
            if inner:
                (folder / "cell").mkdir()
            raise BsaError("no such effect")

    with pytest.raises(BsaError, match="no such effect"):
        refused()
    assert folder.exists() == inner
    if inner:
        assert [event["event"] for event in read_events(folder)] == ["run"]


def test_a_newer_format_is_refused(tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    journal.append("run", format=FORMAT + 1)
    journal.close()
    with pytest.raises(BsaError, match="upgrade"):
        list(read_events(tmp_path))


def test_damage_in_the_middle_is_told_with_its_line(tmp_path: Path) -> None:
    (tmp_path / FILE_NAME).write_text('{"event":"run","format":1}\n{broken\n{"event":"count"}\n')
    with pytest.raises(BsaError, match="damaged at line 2"):
        list(read_events(tmp_path))


def test_a_folder_without_a_run_is_told(tmp_path: Path) -> None:
    with pytest.raises(BsaError, match="holds no run"):
        list(read_events(tmp_path))


@pytest.mark.parametrize(
    "content", ['{"event":"login"}\n', "a note without an end", '[1]\n{"torn', '{"event": "run"}\n', "\0" * 40]
)
def test_a_foreign_journal_is_refused_and_stays_as_it_is(content: str, tmp_path: Path) -> None:
    (tmp_path / FILE_NAME).write_text(content)
    with pytest.raises(BsaError, match="nothing was written"):
        Journal(tmp_path)
    assert (tmp_path / FILE_NAME).read_text() == content


def test_a_journal_that_is_a_link_a_folder_or_a_pipe_is_refused(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").write_text('{"event":"run"}\n{"torn')
    for number, make in enumerate((lambda path: path.symlink_to(tmp_path / "elsewhere"), Path.mkdir, os.mkfifo)):
        folder = tmp_path / str(number)
        folder.mkdir()
        make(folder / FILE_NAME)
        with pytest.raises(BsaError, match="nothing was written"):
            Journal(folder)
    assert (tmp_path / "elsewhere").read_text() == '{"event":"run"}\n{"torn'


def test_a_folder_of_other_files_is_no_place_for_a_run(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").touch()
    with pytest.raises(BsaError, match="is not a run"):
        Journal(tmp_path)
    assert os.listdir(tmp_path) == ["thesis.tex"]


def test_a_folder_that_a_grid_prepared_is(tmp_path: Path) -> None:
    (tmp_path / LOCK).touch()
    (tmp_path / "failure.json").write_text("{}")
    check_run_folder(tmp_path)


def test_every_beginning_of_a_journal_is_ours(tmp_path: Path) -> None:
    line = b'{"event":"run","format":1}\n'
    for size in range(len(line) + 1):
        (tmp_path / FILE_NAME).write_bytes(line[:size])
        check_run_folder(tmp_path)


def test_a_journal_without_an_event_leaves_nothing(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "run")
    journal.append("run")
    journal.clear()
    journal.close()
    assert not (tmp_path / "run").exists()


def test_a_full_disk_tears_no_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    journal = Journal(tmp_path)
    journal.append("run", number=0)

    class Full:
        """Takes half of a line, and then no more."""

        def __init__(self, file: Any) -> None:
            self.file = file

        def write(self, content: bytes) -> int:
            if len(content) < 20:
                raise OSError(errno.ENOSPC, "No space left on device")
            return int(self.file.write(content[: len(content) // 2]))

        def __getattr__(self, name: str) -> Any:
            return getattr(self.file, name)

    full = Full(journal._file)
    monkeypatch.setattr(journal, "_file", full)
    with pytest.raises(BsaError, match="No space left on device") as caught:
        journal.append("count", number=1, filler="x" * 100)
    assert "make room" in caught.value.hint
    monkeypatch.setattr(journal, "_file", full.file)
    journal.append("count", number=2)
    journal.close()
    assert [event["number"] for event in read_events(tmp_path)] == [0, 2]


@pytest.mark.parametrize(
    "line", ["[]", "3", '{"event":3}', '{"event":"run","format":"new"}', "[" * 100_000, '{"event":"run","format":{}}']
)
def test_a_line_of_another_shape_is_damage(line: str, tmp_path: Path) -> None:
    (tmp_path / FILE_NAME).write_text(line + "\n")
    with pytest.raises(BsaError, match="damaged at line 1"):
        list(read_events(tmp_path))


def test_a_run_took_the_time_of_each_time_it_was_taken_up() -> None:
    def events(*told: tuple[str, float | None]) -> list[dict[str, Any]]:
        return [{"event": kind} | ({} if spent is None else {"wall_s": spent}) for kind, spent in told]

    run, resumed = ("run", None), ("resumed", None)
    ended = events(run, ("simulation", 2.0), ("end", 3.0))
    killed = events(resumed, ("simulation", 5.0), ("simulation", 7.0))
    assert spent_s(ended) == 3.0
    assert spent_s([*ended, *killed]) == 10.0, "a run that was killed counts up to its last simulation"
    assert spent_s([*ended, *killed, *events(resumed, ("refused", None), ("end", 0.5))]) == 10.5
    assert spent_s(events(run, ("trial", None), ("end", 1.0), ("trial", None), ("end", 2.0))) == 3.0
