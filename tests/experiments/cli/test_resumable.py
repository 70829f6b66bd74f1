"""An error after simulations says how to go on."""

from pathlib import Path

import pytest
from bsa.core.errors import BsaError
from bsa.core.run.journal import FILE_NAME
from bsa.experiments.cli.resumable import resumable


@pytest.mark.parametrize(
    ("hint", "begins"), [("make room.", "make room. Then"), ("check it", "check it. Then"), ("", "Then")]
)
def test_what_stands_in_the_journal_is_gone_on_with(tmp_path: Path, hint: str, begins: str) -> None:
    def simulate() -> None:
        (tmp_path / FILE_NAME).write_text("what was asked\na simulation\n")
        raise BsaError("the disk is full.", hint)

    with pytest.raises(BsaError, match="disk") as found, resumable(tmp_path, "bsa discover --resume x"):
        simulate()
    assert found.value.hint == f"{begins} go on with: bsa discover --resume x"


def test_before_the_first_simulation_there_is_nothing_to_go_on_with(tmp_path: Path) -> None:
    (tmp_path / FILE_NAME).write_text("an earlier one\n")
    with pytest.raises(BsaError) as found, resumable(tmp_path, "bsa discover --resume x"):
        raise BsaError("the record is gone.", "check the path.")
    assert found.value.hint == "check the path."


def test_what_was_asked_alone_is_nothing_to_go_on_with(tmp_path: Path) -> None:
    """A discovery whose reference was of another test was to be gone on with, and ended with the same error."""

    def begin() -> None:
        (tmp_path / FILE_NAME).write_text("what was asked\n")
        raise BsaError("the record has 7 steps.", "give another.")

    with pytest.raises(BsaError) as found, resumable(tmp_path, "bsa discover --resume x"):
        begin()
    assert found.value.hint == "give another."
