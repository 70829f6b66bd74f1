"""Whether a model fits the memory of this machine's GPUs, and what is said where it does not."""

from __future__ import annotations

from dataclasses import dataclass

from ..core.errors import BsaError

_FOUR_BIT_SHARE = 0.25
"""Least share of its 16-bit size that a model has in 4 bits: the layers that are not quantised come on top."""


@dataclass(frozen=True)
class GpuMemory:
    """Memory of all GPUs of this machine together, in bytes."""

    free: float
    total: float

    @classmethod
    def now(cls) -> GpuMemory:
        """What the driver says, which counts the memory of other processes as taken."""
        import torch

        found = [torch.cuda.mem_get_info(index) for index in range(torch.cuda.device_count())]
        return cls(float(sum(free for free, _ in found)), float(sum(total for _, total in found)))


def refuse_larger(name: str, weight_bytes: float, four_bit: bool, memory: GpuMemory) -> None:
    """Raise `BsaError` before anything is loaded if the weights alone are more than the memory that is free."""
    if weight_bytes * (_FOUR_BIT_SHARE if four_bit else 1.0) > memory.free:
        raise too_large(name, weight_bytes, memory)


def too_large(name: str, weight_bytes: float, memory: GpuMemory | None) -> BsaError:
    """That a model does not fit; ``weight_bytes`` is its size on the GPU without 4-bit weights, 0 if not known."""
    size = f" ({weight_bytes / 1e9:.1f} GB)" if weight_bytes else ""
    room = "" if memory is None else f": {memory.free / 1e9:.1f} of {memory.total / 1e9:.1f} GB are free"
    return BsaError(
        f'the weights of "{name}"{size} do not fit into the memory of the GPU{room}.',
        "end other programs on the GPU (nvidia-smi lists them; each worker of a grid loads a copy: --workers 1), "
        "use 4-bit weights (pip install bitsandbytes), or choose a smaller model or another --via.",
    )
