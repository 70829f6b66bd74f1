"""Which GPUs this machine has, whether a model fits their memory, and what is said where it does not."""

from __future__ import annotations

from collections import Counter
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

    def __str__(self) -> str:
        return f"{self.free / 1e9:.1f} of {self.total / 1e9:.1f} GB are free"


def accelerator() -> str:
    """Where models run: ``"cuda"``, ``"mps"`` or ``"cpu"``."""
    import torch

    if torch.cuda.is_available():
        return "cuda"
    return "mps" if torch.backends.mps.is_available() else "cpu"


def gpu_in_words() -> str:
    """The GPU that models run on and its free memory, or that there is none; imports torch, which takes seconds."""
    kind = accelerator()
    if kind != "cuda":
        return "GPU: mps" if kind == "mps" else "no GPU: local models run on the CPU"
    import torch

    names = Counter(torch.cuda.get_device_name(index) for index in range(torch.cuda.device_count()))
    devices = ", ".join(f"{count} x {name}" if count > 1 else name for name, count in names.items())
    try:
        return f"GPU: {devices} (CUDA), {GpuMemory.now()}"
    except RuntimeError as error:  # other processes have all of it
        return f"GPU: {devices} (CUDA), but it cannot be used: {str(error).partition(chr(10))[0]}"


def refuse_larger(name: str, weight_bytes: float, four_bit: bool, memory: GpuMemory) -> None:
    """Raise `BsaError` before anything is loaded if the weights alone are more than the memory that is free."""
    if weight_bytes * (_FOUR_BIT_SHARE if four_bit else 1.0) > memory.free:
        raise too_large(name, weight_bytes, memory)


def too_large(name: str, weight_bytes: float, memory: GpuMemory | None) -> BsaError:
    """That a model does not fit; ``weight_bytes`` is its size on the GPU without 4-bit weights, 0 if not known."""
    size = f" ({weight_bytes / 1e9:.1f} GB)" if weight_bytes else ""
    room = "" if memory is None else f": {memory}"
    return BsaError(
        f'the weights of "{name}"{size} do not fit into the memory of the GPU{room}.',
        "end other programs on the GPU (nvidia-smi lists them; each worker of a grid loads a copy: --workers 1), "
        "use 4-bit weights (pip install bitsandbytes), or choose a smaller model or another --via.",
    )
