"""Models in this process: loaded once, shared by every run of the process."""

from __future__ import annotations

import gc
import logging
import os
import threading
from dataclasses import dataclass, field
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal

from ..core.errors import BsaError
from ..core.resident_memory import resident_mb
from .gpu_memory import GpuMemory, accelerator, refuse_larger, too_large
from .model_files import bytes_in_sixteen_bits, model_folder, weight_bytes

Quantisation = Literal["auto", "4bit", "none"]
INSTALL_HINT = 'pip install "battery-sim-agent[local]"'

# Beside the weights: activations, cache and fragmentation.
_HEADROOM = 1.2
_FALLBACK_CONTEXT_TOKENS = 4096

_loaded: dict[tuple[str, Quantisation], LoadedModel] = {}
_loading = threading.Lock()
_generating = threading.Lock()


@dataclass(eq=False)
class LoadedModel:
    """Weights and tokenizer."""

    # tokenizer, model: Of transformers.
    tokenizer: Any
    model: Any
    description: str  # Device and number format, for the journal.
    # Held while generating: all models of the process share the random state and the device.
    lock: threading.Lock = field(default_factory=lambda: _generating)
    users: int = 0  # How many backends have it open.
    # Resident memory of the process in MB: before the weights were loaded, and what had come by the end of its first
    # reply, which sets up the GPU's kernels and the grammar.
    before_mb: float = 0.0
    taken_mb: float | None = None

    @property
    def context_tokens(self) -> int:
        """Longest prompt and reply together, in tokens."""
        length = getattr(self.model.config.get_text_config(), "max_position_embeddings", None)
        return length if isinstance(length, int) and length > 0 else _FALLBACK_CONTEXT_TOKENS

    @cached_property
    def end_tokens(self) -> list[int]:
        """Tokens that end a reply."""
        ends = self.model.generation_config.eos_token_id
        if ends is None:
            ends = self.tokenizer.eos_token_id
        return list(ends) if isinstance(ends, (list, tuple)) else [] if ends is None else [ends]

    @cached_property
    def grammar_tokenizer(self) -> Any:
        """The tokenizer as llguidance sees it; None where it cannot (slow tokenizers, llguidance missing)."""
        if find_spec("llguidance") is None:
            return None
        import llguidance.hf

        try:
            vocabulary = self.model.get_output_embeddings().weight.shape[0]
            return llguidance.hf.from_tokenizer(self.tokenizer, n_vocab=vocabulary, eos_token=self.end_tokens or None)
        except (ValueError, AttributeError):
            return None

    def answered(self) -> None:
        """To be called after each reply; the first one tells how much memory of the process the model takes."""
        if self.taken_mb is None:
            self.taken_mb = max(resident_mb() - self.before_mb, 0.0)

    def unload(self) -> None:
        """Let the weights go; it cannot be used afterwards."""
        self.model = self.tokenizer = None
        self.__dict__.pop("grammar_tokenizer", None)


def load(name: str, quantisation: Quantisation) -> LoadedModel:
    """The model from a folder or the Hugging Face hub, from memory if this process has it; `release` gives it back.

    Raises `BsaError` if transformers is not installed, or the model cannot be found or does not fit.
    """
    with _loading:
        key = (name, quantisation)
        if key not in _loaded:
            _unload_idle()
            _loaded[key] = _load(name, quantisation)
        _loaded[key].users += 1
        return _loaded[key]


def release(loaded: LoadedModel) -> None:
    """Give a model back. Its weights stay in memory for the next run, until another model is loaded."""
    with _loading:
        loaded.users -= 1


def taken_mb() -> float:
    """Resident memory of this process that its models take, MB."""
    return sum(model.taken_mb or 0.0 for model in _loaded.values())


def _unload_idle() -> None:
    idle = [key for key, model in _loaded.items() if model.users <= 0]
    if not idle:
        return
    for key in idle:
        _loaded.pop(key).unload()
    gc.collect()
    import torch

    if torch.cuda.is_available():
        torch.cuda.empty_cache()


def _load(name: str, quantisation: Quantisation) -> LoadedModel:
    for package in ("torch", "transformers"):
        if find_spec(package) is None:
            raise BsaError(f"models in this process need {package}, which is not installed.", INSTALL_HINT)
    import torch
    import transformers

    before_mb = resident_mb()
    transformers.logging.set_verbosity_error()
    transformers.logging.disable_progress_bar()
    logging.getLogger("accelerate").setLevel(logging.ERROR)
    memory = None
    if accelerator() == "cuda":
        # Without it cuBLAS does not round alike each time, and the same seed gives other replies (docs/backends.md).
        os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")
        memory = GpuMemory.now()
    # transformers does not know ~ for the home folder.
    source = str(model_folder(name)) if Path(name).expanduser().is_dir() else name
    try:
        config = transformers.AutoConfig.from_pretrained(source)
        tokenizer = transformers.AutoTokenizer.from_pretrained(source)
        arguments = _arguments(source, config, quantisation)
        if memory is not None:
            refuse_larger(name, bytes_in_sixteen_bits(source, config), "quantization_config" in arguments, memory)
        model = transformers.AutoModelForCausalLM.from_pretrained(source, **arguments)
        if "device_map" not in arguments and accelerator() != "cpu":
            model.to(accelerator())
    except (OSError, ValueError) as error:
        reason = str(error).strip().partition("\n")[0][:300]
        is_folder = Path(source).exists() or name.startswith(("/", ".", "~"))
        hint = "check the folder." if is_folder else f"hf download {name}"
        raise BsaError(f'the model "{name}" cannot be loaded: {reason}', hint) from None
    except torch.cuda.OutOfMemoryError:
        raise too_large(name, bytes_in_sixteen_bits(source, config), memory) from None
    if memory is not None and {"cpu", "disk"} & set((getattr(model, "hf_device_map", None) or {}).values()):
        # accelerate leaves in main memory what the GPU does not hold, and moves it there and back for every token.
        raise too_large(name, bytes_in_sixteen_bits(source, config), memory)
    model.eval()
    four_bit = ", 4-bit" if "quantization_config" in arguments else ""
    description = f"{model.device.type}, {str(model.dtype).removeprefix('torch.')}{four_bit}"
    return LoadedModel(tokenizer, model, description, before_mb=before_mb)


def _arguments(name: str, config: Any, quantisation: Quantisation) -> dict[str, Any]:
    """Number format, device and quantisation for this machine."""
    import torch

    device = accelerator()
    arguments: dict[str, Any] = {}
    if device == "cuda" and find_spec("accelerate") is not None:
        arguments["device_map"] = "auto"
    if getattr(config, "quantization_config", None) is not None:
        # The checkpoint is quantised already (MXFP4, GPTQ, ...) and says how.
        return arguments | {"dtype": "auto"}
    if device == "cuda":
        arguments["dtype"] = torch.bfloat16 if torch.cuda.is_bf16_supported() else torch.float16
    elif device == "mps":
        arguments["dtype"] = torch.float16
    else:
        import psutil

        # Most CPUs compute faster in 32 bits; but a model in 16 bits beats one that swaps.
        wide = weight_bytes(name) * 2 * _HEADROOM < psutil.virtual_memory().available
        arguments["dtype"] = torch.float32 if wide else torch.bfloat16
    if _wants_four_bits(name, quantisation, device):
        import transformers

        arguments["quantization_config"] = transformers.BitsAndBytesConfig(
            load_in_4bit=True, bnb_4bit_quant_type="nf4", bnb_4bit_compute_dtype=arguments["dtype"]
        )
    return arguments


def _wants_four_bits(name: str, quantisation: Quantisation, device: str) -> bool:
    available = device == "cuda" and find_spec("bitsandbytes") is not None
    if quantisation == "4bit" and not available:
        raise BsaError("4-bit weights need a CUDA GPU and bitsandbytes.", "pip install bitsandbytes")
    if quantisation == "auto":
        return available and weight_bytes(name) * _HEADROOM > GpuMemory.now().free
    return quantisation == "4bit"
