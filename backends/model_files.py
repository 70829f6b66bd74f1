"""Where the files of a Hugging Face model lie on this machine, found without importing anything heavy."""

import os
from pathlib import Path
from typing import Any


def model_folder(name: str) -> Path | None:
    """The folder with the model's configuration and weights: the name itself, or its newest copy in the hub's cache."""
    given = Path(name).expanduser()
    if (given / "config.json").is_file():
        return given
    home = Path(os.environ.get("HF_HOME") or Path.home() / ".cache" / "huggingface")
    cache = Path(os.environ.get("HF_HUB_CACHE") or home / "hub")
    snapshots = [
        path.parent
        for path in (cache / f"models--{name.replace('/', '--')}" / "snapshots").glob("*/config.json")
        if any(path.parent.glob("*.safetensors")) or any(path.parent.glob("*.bin"))
    ]
    return max(snapshots, key=lambda folder: folder.stat().st_mtime, default=None)


def weight_bytes(name: str) -> int:
    """Size of the model's weight files in bytes; 0 where they are not on this machine."""
    folder = model_folder(name)
    if folder is None:
        return 0
    files = list(folder.glob("*.safetensors")) or list(folder.glob("*.bin"))
    return sum(path.stat().st_size for path in files)


def bytes_in_sixteen_bits(name: str, config: Any) -> float:
    """Size of the weights in bytes once loaded in 16 bits, or as the checkpoint is quantised; 0 where not known.

    ``config`` is the model's configuration, as transformers reads it.
    """
    stored = str(getattr(config, "dtype", None)).removeprefix("torch.")
    quantised = getattr(config, "quantization_config", None) is not None
    return weight_bytes(name) / (2 if stored == "float32" and not quantised else 1)
