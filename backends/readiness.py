"""Which models can be asked on this machine, and the one command that would make each of the others ready."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from shutil import which
from typing import Any

from .addresses import ollama_address, openai_address, shown
from .api_keys import has_key, key_variables, ollama_server_key, openai_server_key, provider_of
from .deadline import within
from .loaded_model import INSTALL_HINT
from .model_files import model_folder
from .options import BackendOptions, Route
from .presets import Preset, load_presets

_LOOK_TIMEOUT_S = 0.8
_OLLAMA_HOME = "https://ollama.com/download"


@dataclass(frozen=True)
class Readiness:
    """Whether a model can be asked by one route.

    Attributes
    ----------
    backend : str
        What to write behind ``--backend``.
    route : str
        The route.
    model : str
        The model's name under that route.
    ready : bool
        Whether it can be asked now.
    detail : str
        Why, or why not.
    remedy : str
        The command that would make it ready; empty if it is.
    """

    backend: str
    route: Route
    model: str
    ready: bool
    detail: str
    remedy: str = ""


def survey(options: BackendOptions | None = None) -> list[Readiness]:
    """Every preset by every route, for ``bsa doctor``. Costs a second at most where no server listens."""
    options = options or BackendOptions()
    return [found for preset in load_presets().values() for found in check_preset(preset, options)]


def check_preset(preset: Preset, options: BackendOptions) -> list[Readiness]:
    """A preset by each of its routes, in its order; of several names under a route the first ready one."""
    found: list[Readiness] = []
    for route, models in preset.models.items():
        checks = [check(preset.name, route, model, options) for model in models]
        found.append(next((item for item in checks if item.ready), checks[0]))
    return found


def check(backend: str, route: Route, model: str, options: BackendOptions) -> Readiness:
    """One model by one route. Looks, but never loads or asks a model."""
    checks = {"openai": _openai, "ollama": _ollama, "transformers": _transformers, "litellm": _litellm}
    problem, remedy = checks[route](model, options)
    return Readiness(backend, route, model, not problem, problem or "ready", remedy)


def _openai(model: str, options: BackendOptions) -> tuple[str, str]:
    by_option = options.base_url if options.via in (None, "openai") else None
    address = openai_address(by_option)
    if address is None:
        return "no server named", f"vllm serve {model}  # then --base-url http://127.0.0.1:8000/v1"
    content, problem = _look(f"{address}/models", openai_server_key(address, by_option is not None))
    if problem:
        return f"{shown(address)}: {problem}", f"vllm serve {model}"
    listed = content.get("data") if isinstance(content, Mapping) else None
    served = [str(item.get("id")) for item in listed or [] if isinstance(item, Mapping)]
    if served and model not in served:
        return f"{shown(address)} serves {', '.join(served[:3])}", f"vllm serve {model}"
    return "", ""


def _ollama(model: str, options: BackendOptions) -> tuple[str, str]:
    by_option = options.base_url if options.via == "ollama" else None
    address = ollama_address(by_option)
    content, problem = _look(f"{address}/api/tags", ollama_server_key(address, by_option is not None))
    if problem:
        installed = which("ollama") is not None
        return f"Ollama {problem}", "ollama serve" if installed else f"install Ollama ({_OLLAMA_HOME})"
    listed = content.get("models") if isinstance(content, Mapping) else None
    held = {str(item.get("model") or item.get("name")) for item in listed or [] if isinstance(item, Mapping)}
    if not {model, f"{model}:latest"} & held:
        return "Ollama does not hold it", f"ollama pull {model}"
    return "", ""


def _transformers(model: str, options: BackendOptions) -> tuple[str, str]:
    missing = [package for package in ("torch", "transformers", "llguidance") if find_spec(package) is None]
    if missing:
        return f"{' and '.join(missing)} not installed", INSTALL_HINT
    if model_folder(model) is None:
        return "not downloaded", f"hf download {model}"
    return "", ""


def _litellm(model: str, options: BackendOptions) -> tuple[str, str]:
    provider = provider_of(model)
    if not has_key(provider):
        variable = key_variables(provider)[0]
        return f"no key for {provider}", f"export {variable}=..."
    return "", ""


def _look(address: str, key_variable: str | None) -> tuple[Any, str]:
    """The JSON at an address and an empty string, or None and what is wrong."""
    return _look_once(address, os.environ.get(key_variable or ""), os.getpid())


@cache
def _look_once(address: str, key: str | None, _process: int) -> tuple[Any, str]:
    import httpx

    from .bounded_http import OwnServerTransport
    from .reaching import connection_failure

    def ask() -> httpx.Response:
        with httpx.Client(transport=OwnServerTransport(key), timeout=_LOOK_TIMEOUT_S) as client:
            return client.get(address)

    try:
        response = within(_LOOK_TIMEOUT_S, ask)
        if response.status_code != 200:
            return None, f"answers with HTTP status {response.status_code}"
        return response.json(), ""
    except (httpx.TimeoutException, TimeoutError):
        return None, f"does not answer within {_LOOK_TIMEOUT_S} s"
    except httpx.RequestError as error:
        return None, f"does not answer ({connection_failure(error)})"
    except (ValueError, RecursionError):
        return None, "answers with something else than JSON"


def forget_looks() -> None:
    """Look again next time: servers come and go."""
    _look_once.cache_clear()
