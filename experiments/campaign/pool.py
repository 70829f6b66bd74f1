"""What carries out orders: processes of this machine, or a cluster."""

from collections.abc import Sequence
from typing import Protocol

from .cell import Order, Report


class Pool(Protocol):
    """Workers, wherever they are."""

    @property
    def free(self) -> int:
        """How many more orders may be handed over now."""
        ...

    @property
    def workers(self) -> int:
        """How many cells run side by side."""
        ...

    def submit(self, order: Order) -> None:
        """Hand over an order; `free` was at least 1."""
        ...

    def collect(self, patience_s: float) -> Sequence[Report]:
        """Wait until a report is there, ``patience_s`` at most. A worker that died reports its cell as lost."""
        ...

    def close(self) -> None:
        """End the workers at once; what they were doing stands in its journal."""
        ...
