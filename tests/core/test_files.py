"""Files are written whole or not at all, and nothing that is not ours is touched."""

import errno
import json
import os
from pathlib import Path

import pytest
from bsa.core.errors import BsaError
from bsa.core.files import begins, entries, file_error, read_json, replacing, write_json, write_text


def test_a_link_is_replaced_not_followed(tmp_path: Path) -> None:
    outside = tmp_path / "outside.txt"
    outside.write_text("mine")
    link = tmp_path / "folder" / "result.json"
    link.parent.mkdir()
    link.symlink_to(outside)
    write_text(link, "ours")
    assert outside.read_text() == "mine"
    assert link.read_text() == "ours"
    assert not link.is_symlink()


def test_a_draft_is_new_and_has_a_name_that_nobody_can_foresee(tmp_path: Path) -> None:
    seen: list[set[str]] = []
    for _ in range(2):
        with replacing(tmp_path / "a.txt") as file:
            file.write(b"x")
            seen.append(set(os.listdir(tmp_path)) - {"a.txt"})
    assert len(seen[0]) == len(seen[1]) == 1
    assert seen[0] != seen[1]
    assert os.listdir(tmp_path) == ["a.txt"]


def _fill_the_disk(path: Path) -> None:
    with replacing(path) as file:
        file.write(b"half")
        raise OSError(errno.ENOSPC, "No space left on device")


def test_what_stood_there_stays_when_the_new_file_fails(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text("old")
    with pytest.raises(TypeError):
        write_json(path, {"a": object()})
    with pytest.raises(BsaError, match=r"a\.json cannot be used: No space left") as caught:
        _fill_the_disk(path)
    assert "make room" in caught.value.hint
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.json"]


def test_the_rights_are_those_of_any_new_file(tmp_path: Path) -> None:
    (tmp_path / "usual").touch()
    write_text(tmp_path / "ours", "")
    assert (tmp_path / "ours").stat().st_mode == (tmp_path / "usual").stat().st_mode


@pytest.mark.parametrize(
    ("path", "hint"),
    [("file/inside/a.txt", "is a file"), ("folder", "it is a folder"), ("x" * 300, "shorter name")],
)
def test_a_path_that_cannot_be(path: str, hint: str, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "folder").mkdir()
    with pytest.raises(BsaError) as caught:
        write_text(tmp_path / path, "text")
    assert hint in caught.value.hint
    assert set(os.listdir(tmp_path)) == {"file", "folder"}


def test_text_that_utf8_cannot_hold(tmp_path: Path) -> None:
    write_text(tmp_path / "a", "a\udc80b")
    assert (tmp_path / "a").read_text() == "a?b"


@pytest.mark.parametrize("text", ["", "[]", "{", "[" * 100_000, '{"a": ' + "9" * 5000 + "}", "\xff", "3"])
def test_json_that_is_no_object_is_none(text: str, tmp_path: Path) -> None:
    (tmp_path / "a.json").write_bytes(text.encode("latin-1"))
    assert read_json(tmp_path / "a.json") is None


def test_json_object(tmp_path: Path) -> None:
    write_json(tmp_path / "a.json", {"µ": 1})
    assert read_json(tmp_path / "a.json") == {"µ": 1} == json.loads((tmp_path / "a.json").read_text())
    assert read_json(tmp_path / "gone.json") is None
    assert read_json(tmp_path) is None


def test_a_folder_that_stands_for_nothing(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    (tmp_path / "file").touch()
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / ".0123.bsa-draft").touch()
    assert entries(tmp_path / "absent") == entries(tmp_path / "folder") == set()
    for name in ("link", "file"):
        with pytest.raises(BsaError):
            entries(tmp_path / name)


def test_beginnings(tmp_path: Path) -> None:
    path = tmp_path / "a"
    for content, ours in ((b"", True), (b"{", True), (b'{"event"', True), (b'{"event":"run",', True), (b"[", False)):
        path.write_bytes(content)
        assert begins(path, b'{"event":"run"') is ours
    (tmp_path / "link").symlink_to(path)
    path.write_bytes(b"")
    assert not begins(tmp_path / "link", b"x")
    assert not begins(tmp_path, b"x")
    os.mkfifo(tmp_path / "pipe")
    assert not begins(tmp_path / "pipe", b"x")


def test_errors_name_the_path_and_the_reason() -> None:
    error = file_error(OSError(errno.EACCES, "Permission denied", "/x/y"))
    assert (error.message, error.hint) == (
        "/x/y cannot be used: Permission denied.",
        "check the rights of the path, or choose another.",
    )
    assert "refuses: strange" in file_error(OSError("strange")).message
