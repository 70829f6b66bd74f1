"""No process outlives the one that started it, whatever it is doing when that is killed."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

PARENT = """
import ctypes, multiprocessing, os, time
from bsa.core.run.parentage import end_with_parent


def child(pipe, at_once, busy):
    end_with_parent(at_once)
    pipe.send(os.getpid())
    if busy:
        ctypes.PyDLL(None).sleep(60)  # compiled code that no other thread of Python can interrupt
    time.sleep(60)


if __name__ == "__main__":
    ours, theirs = multiprocessing.Pipe()
    start = multiprocessing.get_context("spawn").Process
    start(target=child, args=(theirs, {at_once}, {busy}), daemon=True).start()
    print(ours.recv(), flush=True)
    time.sleep(60)
"""


def alive(pid: int) -> bool:
    """Whether a process runs; one that has ended and waits to be noticed does not."""
    said = subprocess.run(["ps", "-o", "stat=", "-p", str(pid)], capture_output=True, text=True, check=False).stdout
    return bool(said.strip()) and not said.strip().startswith("Z")


@pytest.mark.parametrize(
    ("at_once", "busy"),
    [
        (False, False),
        (True, False),
        pytest.param(True, True, marks=pytest.mark.skipif(sys.platform != "linux", reason="needs the kernel's help")),
    ],
)
def test_a_child_ends_with_its_killed_parent(tmp_path: Path, at_once: bool, busy: bool) -> None:
    script = tmp_path / "parent.py"
    script.write_text(PARENT.replace("{at_once}", str(at_once)).replace("{busy}", str(busy)))
    parent = subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    child = int(parent.stdout.readline())
    assert alive(child)
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    ended = time.monotonic() + 20
    while alive(child):
        assert time.monotonic() < ended
        time.sleep(0.05)
