"""Broken distributions beside this one: every command works, and who uses them by name is told in one line."""

import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from bsa.experiments.cli.main import main, run_main

Install = Callable[..., Path]

FAULTY = """
from bsa.core.hooks import Entry, hookimpl

class Memory:
    def __init__(self, options, context):
        raise RuntimeError("boom")

@hookimpl
def bsa_memories():
    yield Entry("zz-mem", Memory, "Fails when it is made.", api=1)
    yield Entry("zz-old", Memory, "Of another interface.", api=0)
    raise OSError("no disk")
"""
LEAVING = "import sys\nsys.exit(0)"


@pytest.fixture(autouse=True)
def _installed(stranger: Install, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stranger(FAULTY)
    stranger(LEAVING, "zz-leaving", "2.0")
    monkeypatch.chdir(tmp_path)


def test_the_list_says_what_is_not_usable_and_why(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["bsa", "list", "plugins"])
    with pytest.raises(SystemExit) as caught:
        main()
    assert caught.value.code == 0
    usable, unusable = capsys.readouterr().out.split("not usable\n")
    assert "zz-mem" in usable
    assert "pybamm" in usable
    rows = [" ".join(row.split()) for row in unusable.strip().splitlines()]
    assert rows == [
        "plugin zz-leaving zz-leaving 2.0 cannot be imported: SystemExit: 0",
        "plugin zz-fault zz-fault 0.1 OSError: no disk in bsa_memories",
        "memory zz-old zz-fault 0.1 it was written for plugin interface 0, but this is interface 1",
    ]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("zz-mem", "BsaError: memory zz-mem of zz-fault 0.1: boom in its factory. Hint: RuntimeError at zz_module_"),
        ("zz-old", 'BsaError: the memory "zz-old" cannot be used (zz-fault 0.1: it was written for plugin interface 0'),
        ("zz-other", "zz-leaving 2.0 cannot be used (cannot be imported: SystemExit: 0)."),
    ],
)
def test_only_its_user_is_stopped_in_one_line(
    name: str, words: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["bsa-run", "--set", f'memories=["{name}"]', "--out", "run"])
    with pytest.raises(SystemExit) as caught:
        run_main()
    assert caught.value.code == 2
    said = capsys.readouterr().err
    assert words in said
    assert "Traceback" not in said
    assert len([line for line in said.splitlines() if line.startswith("BsaError")]) == 1
