"""From what is written behind ``--backend`` to a backend."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..core.errors import BsaError, did_you_mean
from ..core.hooks import Entry
from ..core.messages import Backend
from ..core.registry import Registry, installed
from .options import BackendOptions, Route
from .presets import Preset

_WRAPPERS = {"votes", "review"}


def open_backend(spec: str, options: BackendOptions | None = None, registry: Registry | None = None) -> Backend:
    """Open a language model.

    Parameters
    ----------
    spec : str
        ``NAME`` or ``NAME:MODEL``: a preset (``qwen2.5-14b``), a route and its model
        (``litellm:openai/o3``, ``openai:my-model``, ``ollama:qwen2.5:14b``, ``transformers:PATH``,
        ``replay:RUN``), ``manual``, ``rules``, or what a third party offers.
    options : BackendOptions, optional
        What is to be set.
    registry : Registry, optional
        Where to look the name up; the installed one if unset.

    Returns
    -------
    Backend
        Wrapped for votes and review where asked for.

    Raises
    ------
    BsaError
        If there is no such backend, or it is not ready; the hint says what would make it so.
    """
    options = options or BackendOptions()
    registry = registry or installed()
    name, colon, model = spec.partition(":")
    if colon and not model:
        raise BsaError(f'the backend "{spec}" names no model behind its colon.', f"write {name}:MODEL.")
    if model:
        options = options.model_copy(update={"model": model})
    backend: Backend = _open(registry, name, options)
    if options.votes > 1:
        from .voting import VotingBackend

        backend = VotingBackend(backend, options.votes)
    if options.review:
        from .reviewing import ReviewingBackend

        backend = ReviewingBackend(backend)
    return backend


def _open(registry: Registry, name: str, options: BackendOptions) -> Backend:
    names = registry.names("backend")
    if name not in names:
        nearest = did_you_mean(name, names)
        raise BsaError(
            f'there is no backend "{name}".',
            f"{nearest} " * bool(nearest)
            + f"Available: {', '.join(sorted(names))}; litellm:PROVIDER/MODEL takes any model that litellm knows.",
        )
    entry: Entry = registry.get("backend", name)
    if entry.config_type is BackendOptions:
        backend: Backend = entry.factory(options)
        return backend
    # Only what was set: a backend with its own options refuses what it does not know.
    settings: dict[str, Any] = options.model_dump(include=options.model_fields_set - _WRAPPERS)
    made: Backend = entry.factory(registry.configure("backend", name, settings))
    return made


def open_preset(preset: Preset, options: BackendOptions) -> Backend:
    """A preset's model by ``options.via``, or by the first route that is ready.

    Raises
    ------
    BsaError
        If the preset has no such route, or none is ready; the hint names the way to each.
    """
    from .readiness import check_preset, forget_looks

    if options.model is not None:
        raise BsaError(f'"{preset.name}" names its model itself.', f"leave out :{options.model}.")
    if options.via is not None and options.via not in preset.models:
        raise BsaError(
            f'"{preset.name}" cannot be reached via {options.via}.', f"its routes are {', '.join(preset.models)}."
        )
    forget_looks()
    found = check_preset(preset, options)
    considered = [item for item in found if options.via in (None, item.route)]
    if options.base_url is not None and options.via is None:
        # An address without a route can only mean a server of that kind.
        considered = [item for item in found if item.route == "openai"]
    ready = next((item for item in considered if item.ready), None)
    if ready is None and options.via == "transformers" and considered[0].detail == "not downloaded":
        # Asked for by name, the weights are fetched by transformers itself.
        ready = considered[0]
    if ready is None:
        ways = "; ".join(f"{item.route} ({item.detail}): {item.remedy}" for item in considered)
        raise BsaError(f'the model "{preset.name}" is not ready on this machine.', ways)
    return open_route(ready.route, ready.model, options, f"{preset.name} via {ready.route}")


def open_route(route: Route, model: str | None, options: BackendOptions, name: str | None = None) -> Backend:
    """A model by a given route.

    Raises
    ------
    BsaError
        If no model is named or the route cannot reach it.
    """
    if not model:
        raise BsaError(f'the backend "{route}" needs a model.', f"write {route}:MODEL.")
    opener = _OPENERS[route]
    backend: Backend = opener(model, options, name or f"{route}:{model}")
    return backend


def _openai(model: str, options: BackendOptions, name: str) -> Backend:
    from .litellm_route import openai_compatible

    return openai_compatible(model, options, name)


def _litellm(model: str, options: BackendOptions, name: str) -> Backend:
    from .litellm_route import hosted

    return hosted(model, options, name)


def _ollama(model: str, options: BackendOptions, name: str) -> Backend:
    from .ollama_route import OllamaBackend

    return OllamaBackend(model, options, name)


def _transformers(model: str, options: BackendOptions, name: str) -> Backend:
    from .transformers_route import TransformersBackend

    return TransformersBackend(model, options, name)


_OPENERS: dict[Route, Callable[[str, BackendOptions, str], Backend]] = {
    "openai": _openai,
    "ollama": _ollama,
    "transformers": _transformers,
    "litellm": _litellm,
}
