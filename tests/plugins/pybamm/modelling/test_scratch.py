"""What a process leaves behind that was ended is removed."""

import subprocess
import sys
from pathlib import Path

import pytest
from bsa.plugins.pybamm.modelling.scratch import remove_scratch_of, scratch_folder


def test_folders_of_a_process_that_was_killed_are_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    code = (
        "import os, tempfile\n"
        f"tempfile.tempdir = {str(tmp_path)!r}\n"
        "from bsa.plugins.pybamm.modelling.scratch import scratch_folder\n"
        "folder = scratch_folder()\n"
        "os.kill(os.getpid(), 9)"
    )
    ended = subprocess.Popen([sys.executable, "-c", code])
    ended.wait()
    with scratch_folder() as own:
        assert len(list(tmp_path.iterdir())) == 2
        remove_scratch_of(ended.pid)
        assert list(tmp_path.iterdir()) == [Path(own)]
