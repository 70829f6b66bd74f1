"""Actions that do not depend on one another, each waiting for simulations of its own."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

T = TypeVar("T")


def side_by_side(actions: Sequence[Callable[[], T]], at_once: int) -> list[T]:
    """What several actions return, in order; so many run at a time, at 1 in the calling thread.

    Threads wait while worker processes simulate, so that threads are enough. Raises what the first action to fail
    raised: those not begun are left out, and nobody waits for the others.
    """
    if at_once <= 1 or len(actions) <= 1:
        return [action() for action in actions]
    threads = ThreadPoolExecutor(at_once, thread_name_prefix="bsa-discovery")
    try:
        running = [threads.submit(action) for action in actions]
        return [future.result() for future in running]
    finally:
        threads.shutdown(wait=False, cancel_futures=True)
