"""Ends the wait for a call that does not end by itself."""

import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

T = TypeVar("T")


def within(seconds: float, call: Callable[[], T]) -> T:
    """The call's result, if it comes in time.

    HTTP clients limit the wait for each byte, not for the answer: a server that sends one byte a second
    would hold them for ever. The call is left behind in a daemon thread, which its own time-outs end.

    Raises `TimeoutError` if there is no result after ``seconds``.
    """
    answer: Future[T] = Future()

    def work() -> None:
        try:
            answer.set_result(call())
        except BaseException as error:
            answer.set_exception(error)

    thread = threading.Thread(target=work, daemon=True, name="bsa-call")
    thread.start()
    thread.join(seconds)
    if thread.is_alive():
        raise TimeoutError(f"no answer within {seconds:.3g} s")
    return answer.result()
