"""Linear algebra takes one thread a process."""

import os

import numpy as np
from bsa.core.threads import VARIABLES, on_one_thread, one_thread_for_children
from threadpoolctl import threadpool_info


def threads() -> set[int]:
    np.ones((2, 2)) @ np.ones((2, 2))
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


def test_a_function_takes_one_thread_and_leaves_the_others_as_they_were() -> None:
    before = threads()
    assert on_one_thread(threads)() == {1}
    assert threads() == before


def test_children_inherit_one_thread_and_the_parent_keeps_its_own(monkeypatch) -> None:
    first, second, *_ = VARIABLES
    monkeypatch.setenv(first, "3")
    monkeypatch.delenv(second, raising=False)
    with one_thread_for_children():
        assert {os.environ[name] for name in VARIABLES} == {"1"}
    assert os.environ[first] == "3"
    assert second not in os.environ
