"""How many threads linear algebra takes: one a process.

The matrices here are small. More threads gain nothing on an idle machine; on a busy one they wait for each other, and a
thousand products take thirty times as long.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import threadpool_limits

VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS")
"""What libraries read when they are loaded."""

on_one_thread = threadpool_limits.wrap(limits=1, user_api="blas")
"""Decorates a function whose products of matrices are to take one thread."""


@contextmanager
def one_thread_for_children() -> Iterator[None]:
    """Processes that are started meanwhile inherit one thread each: the parallelism is in the processes."""
    before = {name: os.environ.get(name) for name in VARIABLES}
    os.environ.update(dict.fromkeys(VARIABLES, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
