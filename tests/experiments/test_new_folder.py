"""A folder for results is found to be usable before the work."""

import pytest
from bsa.core.errors import BsaError
from bsa.experiments.new_folder import new_folder


def test_it_is_there_for_the_block_and_stays_with_what_is_in_it(tmp_path):
    with new_folder(tmp_path / "a" / "b") as folder:
        assert folder.is_dir()
        (folder / "result").write_text("x")
    assert (tmp_path / "a" / "b" / "result").is_file()


def test_nothing_is_left_where_the_block_made_nothing(tmp_path):
    with pytest.raises(BsaError, match="record"), new_folder(tmp_path / "a" / "b"):
        raise BsaError("the record is wrong")
    assert list(tmp_path.iterdir()) == []


def test_an_empty_folder_is_taken_and_left(tmp_path):
    with new_folder(tmp_path):
        pass
    assert tmp_path.is_dir()


def test_a_folder_with_anything_in_it_is_refused(tmp_path):
    (tmp_path / "prediction.json").write_text("{}")
    with pytest.raises(BsaError, match="is not empty"), new_folder(tmp_path):
        raise AssertionError("the block must not begin")
    assert (tmp_path / "prediction.json").read_text() == "{}"


def test_a_place_that_cannot_be_written_to_is_refused_before_the_block(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(BsaError, match="cannot be used"), new_folder(tmp_path / "file" / "x"):
        raise AssertionError("the block must not begin")


def test_a_folder_without_rights_is_refused_before_the_block(tmp_path, monkeypatch):
    def denied(**where):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("tempfile.TemporaryFile", denied)
    with pytest.raises(BsaError, match="Permission denied") as found, new_folder(tmp_path / "x"):
        raise AssertionError("the block must not begin")
    assert "choose another" in found.value.hint
    assert list(tmp_path.iterdir()) == []
