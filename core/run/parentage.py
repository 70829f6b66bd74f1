"""Processes that end with the one that started them, however that ends."""

import ctypes
import multiprocessing
import os
import signal
import sys
import threading

_PR_SET_PDEATHSIG = 1


def end_with_parent(at_once: bool = False) -> None:
    """End this process as soon as the one that started it is gone, killed or not.

    ``at_once``: the kernel may see to it, where it can (Linux), so that compiled code that runs for long does not keep
    the process alive. The kernel means the *thread* that started this process, so only where that was the main thread,
    which lasts as long as its process.
    """
    parent = multiprocessing.parent_process()
    if parent is None:
        return
    if at_once and sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    # Everywhere else, and for a parent that was gone before the kernel was told.
    threading.Thread(target=_follow, args=(parent,), daemon=True).start()


def _follow(parent: multiprocessing.process.BaseProcess) -> None:
    parent.join()
    # What was half done stands in a journal; finished unseen, it would keep others waiting for it.
    os._exit(1)
