"""Ends the wait for a call that does not end by itself."""

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")


class _Box(Generic[T]):
    result: T
    error: BaseException | None = None


def within(seconds: float, call: Callable[[], T]) -> T:
    """The call's result, if it comes in time.

    HTTP clients limit the wait for each byte, not for the answer: a server that sends one byte a second
    would hold them for ever. The call is left behind in a daemon thread, which its own time-outs end.

    Raises `TimeoutError` if there is no result after ``seconds``.
    """
    box: _Box[T] = _Box()

    def work() -> None:
        try:
            box.result = call()
        except BaseException as error:
            box.error = error

    thread = threading.Thread(target=work, daemon=True, name="bsa-call")
    thread.start()
    thread.join(seconds)
    if thread.is_alive():
        raise TimeoutError(f"no answer within {seconds:.3g} s")
    if box.error is not None:
        raise box.error
    return box.result
