import signal
import subprocess
import sys
import threading

import pytest
from bsa.core.run.interrupts import interrupts_stay, interrupts_wait


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_waits_for_the_end_of_the_block(number: signal.Signals) -> None:
    heard: list[str] = []
    before = signal.signal(number, lambda *_: heard.append("handler"))
    try:
        with interrupts_wait():
            signal.raise_signal(number)
            heard.append("block")
        assert heard == ["block", "handler"]
        signal.raise_signal(number)
        assert heard == ["block", "handler", "handler"]
    finally:
        signal.signal(number, before)


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_is_raised_once_the_block_is_done() -> None:
    done: list[bool] = []

    def interrupted() -> None:
        with interrupts_wait():
            signal.raise_signal(signal.SIGINT)
            done.append(True)

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert done == [True]


def test_an_ignored_signal_stays_ignored() -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with interrupts_wait():
            signal.raise_signal(signal.SIGINT)
        assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def test_other_threads_go_on_as_they_are() -> None:
    ran: list[bool] = []

    def body() -> None:
        with interrupts_wait():
            ran.append(True)

    thread = threading.Thread(target=body)
    thread.start()
    thread.join()
    assert ran == [True]


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="signal masks are POSIX")
@pytest.mark.usefixtures("ctrl_c")
def test_a_process_started_in_the_block_does_not_hear_ctrl_c() -> None:
    program = "import signal, sys; signal.raise_signal(signal.SIGINT); sys.exit(7)"
    with interrupts_wait():
        shielded = subprocess.Popen([sys.executable, "-c", program], stderr=subprocess.DEVNULL)
    assert shielded.wait() == 7
    assert subprocess.run([sys.executable, "-c", program], stderr=subprocess.DEVNULL, check=False).returncode != 7


def test_a_library_does_not_keep_ctrl_c(ctrl_c: object) -> None:
    with interrupts_stay():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    assert signal.getsignal(signal.SIGINT) is ctrl_c
