from collections.abc import Iterator
from typing import Any

import pytest
from bsa.plugins.pybamm.processes import Pool


def test_a_pool_that_is_closed_meanwhile_gives_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    # Ctrl-C ends the workers while other threads wait for them: that is no failed simulation.
    pool: Pool[int, str] = Pool(None, 1, 1.0)  # type: ignore[arg-type]
    monkeypatch.setattr(pool.workers[0], "submit", lambda job, allowance: None)

    def ended(busy: list[Any]) -> Iterator[tuple[Any, str]]:
        pool.close()
        yield busy[0], "the simulator process died"

    monkeypatch.setattr(pool, "_finished", ended)
    with pytest.raises(RuntimeError, match="were ended"):
        list(pool.run([1]))
