"""Ctrl-C kept waiting where it would leave a process half started, and kept from libraries that take it."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_ASKED_TO_STOP = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def interrupts_wait() -> Iterator[None]:
    """Let Ctrl-C and SIGTERM wait until the block is done; processes started in it never hear Ctrl-C.

    A process cut off between its birth and its first message can be neither used nor ended, and at a terminal Ctrl-C
    reaches the child too, before it could say that only its parent decides what that means.
    """
    if not in_main_thread():
        yield  # Signals are handled in the main thread alone.
        return
    waiting: list[int] = []
    before = {number: signal.signal(number, lambda number, _: waiting.append(number)) for number in _ASKED_TO_STOP}
    _block_for_children(True)
    try:
        yield
    finally:
        _block_for_children(False)
        for number, handler in before.items():
            # None: a handler that was not set from Python, which cannot be put back from here.
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
        for late in waiting:
            signal.raise_signal(late)


@contextmanager
def interrupts_stay() -> Iterator[None]:
    """Put back what Ctrl-C does after the block: some libraries take it for themselves when they are imported."""
    before = signal.getsignal(signal.SIGINT)
    try:
        yield
    finally:
        if before is not None and in_main_thread():
            signal.signal(signal.SIGINT, before)


def in_main_thread() -> bool:
    """Whether the caller runs in the process's main thread: only that handles signals, and lasts to the end."""
    return threading.current_thread() is threading.main_thread()


def _block_for_children(blocked: bool) -> None:
    # The mask is inherited, handlers are not; where there is none (Windows), children start without it.
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_BLOCK if blocked else signal.SIG_UNBLOCK, {signal.SIGINT})
