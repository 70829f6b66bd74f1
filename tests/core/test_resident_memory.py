"""Memory that this process takes."""

import numpy as np
import pytest
from bsa.core.resident_memory import resident_mb


@pytest.mark.skipif(resident_mb() == 0, reason="this system does not tell the memory of a process")
def test_what_is_written_to_counts():
    before = resident_mb()
    held = np.ones(8_000_000)
    assert resident_mb() - before == pytest.approx(held.nbytes / 1e6, rel=0.2)
