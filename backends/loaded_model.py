"""Models in this process: loaded once, shared by every run of a grid."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal

from ..core.errors import BsaError
from .model_files import weight_bytes

Quantisation = Literal["auto", "4bit", "none"]
INSTALL_HINT = 'pip install "battery-sim-agent[local]"'

# Beside the weights: activations, cache and fragmentation.
_HEADROOM = 1.2
_FALLBACK_CONTEXT_TOKENS = 4096

_loaded: dict[tuple[str, Quantisation], LoadedModel] = {}
_loading = threading.Lock()


@dataclass(eq=False)
class LoadedModel:
    """Weights and tokenizer."""

    # tokenizer, model: Of transformers.
    tokenizer: Any
    model: Any
    description: str  # Device and number format, for the journal.
    # Held while generating: the random state and the device are shared.
    lock: threading.Lock = field(default_factory=threading.Lock)

    @property
    def context_tokens(self) -> int:
        """Longest prompt and reply together, in tokens."""
        length = getattr(self.model.config, "max_position_embeddings", None)
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


def load(name: str, quantisation: Quantisation) -> LoadedModel:
    """The model from a folder or the Hugging Face hub, from memory if this process has it.

    Raises `BsaError` if transformers is not installed, or the model cannot be found or does not fit.
    """
    with _loading:
        key = (name, quantisation)
        if key not in _loaded:
            _loaded[key] = _load(name, quantisation)
        return _loaded[key]


def _load(name: str, quantisation: Quantisation) -> LoadedModel:
    for package in ("torch", "transformers"):
        if find_spec(package) is None:
            raise BsaError(f"models in this process need {package}, which is not installed.", INSTALL_HINT)
    import torch
    import transformers

    transformers.logging.set_verbosity_error()
    transformers.logging.disable_progress_bar()
    try:
        config = transformers.AutoConfig.from_pretrained(name)
        tokenizer = transformers.AutoTokenizer.from_pretrained(name)
        arguments = _arguments(name, config, quantisation)
        model = transformers.AutoModelForCausalLM.from_pretrained(name, **arguments)
    except (OSError, ValueError) as error:
        reason = str(error).strip().partition("\n")[0][:300]
        hint = "check the folder." if Path(name).exists() else f"hf download {name}"
        raise BsaError(f'the model "{name}" cannot be loaded: {reason}', hint) from None
    except torch.cuda.OutOfMemoryError:
        raise BsaError(
            f'the model "{name}" does not fit into the memory of the GPU.',
            "pip install bitsandbytes (for 4-bit weights), or choose a smaller model or another --via.",
        ) from None
    if "device_map" not in arguments and _accelerator() != "cpu":
        model.to(_accelerator())
    model.eval()
    four_bit = ", 4-bit" if "quantization_config" in arguments else ""
    return LoadedModel(tokenizer, model, f"{model.device.type}, {str(model.dtype).removeprefix('torch.')}{four_bit}")


def _accelerator() -> str:
    import torch

    if torch.cuda.is_available():
        return "cuda"
    return "mps" if torch.backends.mps.is_available() else "cpu"


def _arguments(name: str, config: Any, quantisation: Quantisation) -> dict[str, Any]:
    """Number format, device and quantisation for this machine."""
    import torch

    device = _accelerator()
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
        # Most CPUs compute faster in 32 bits; but a model in 16 bits beats one that swaps.
        wide = weight_bytes(name) * 2 * _HEADROOM < _free_memory_bytes()
        arguments["dtype"] = torch.float32 if wide else torch.bfloat16
    if _wants_four_bits(name, quantisation, device):
        import transformers

        arguments["quantization_config"] = transformers.BitsAndBytesConfig(
            load_in_4bit=True, bnb_4bit_quant_type="nf4", bnb_4bit_compute_dtype=arguments["dtype"]
        )
    return arguments


def _wants_four_bits(name: str, quantisation: Quantisation, device: str) -> bool:
    import torch

    if quantisation == "none":
        return False
    available = device == "cuda" and find_spec("bitsandbytes") is not None
    if quantisation == "4bit":
        if not available:
            raise BsaError("4-bit weights need a CUDA GPU and bitsandbytes.", "pip install bitsandbytes")
        return True
    if not available:
        return False
    memory = sum(torch.cuda.mem_get_info(index)[0] for index in range(torch.cuda.device_count()))
    return bool(weight_bytes(name) * _HEADROOM > memory)


def _free_memory_bytes() -> float:
    import psutil

    return float(psutil.virtual_memory().available)
