"""From what is written behind ``--backend`` to a backend."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from pydantic import ValidationError

from ..core.errors import BsaError
from ..core.messages import Backend
from ..core.registry import Registry, installed
from ..core.validation import explain
from .checked import CheckedBackend
from .options import BackendOptions, Route
from .presets import Preset

_WRAPPERS = {"votes", "review"}
"""Options that stand around any backend and are none of its own."""


Given = Mapping[str, Any] | BackendOptions
"""Options of a backend, as written; as `BackendOptions` where it is one of ours."""


def open_backend(spec: str, options: Given | None = None, registry: Registry | None = None) -> Backend:
    """Open a language model.

    Parameters
    ----------
    spec : str
        ``NAME`` or ``NAME:MODEL``: a preset (``qwen2.5-14b``), a route and its model
        (``litellm:openai/o3``, ``openai:my-model``, ``ollama:qwen2.5:14b``, ``transformers:PATH``,
        ``replay:RUN``), ``manual``, ``rules``, or what a third party offers.
    options : mapping or BackendOptions, optional
        Options of the backend, only what is to be set. They are checked against its ``config_type``; ``votes`` and
        ``review`` go with any backend.
    registry : Registry, optional
        Where to look the name up; the installed one if unset.

    Returns
    -------
    Backend
        Checked, and wrapped for votes and review where asked for.

    Raises
    ------
    BsaError
        If there is no such backend, it has no such option, or it is not ready; the hint says what would make it so.
    """
    registry = registry or installed()
    name, own, around = _parted(spec, options, registry)
    backend: Backend = CheckedBackend(registry.make("backend", name, own), registry.find("backend", name).who)
    if around.votes > 1:
        from .voting import VotingBackend

        backend = VotingBackend(backend, around.votes)
    if around.review:
        from .reviewing import ReviewingBackend

        backend = ReviewingBackend(backend)
    return backend


def check_backend(spec: str, options: Given | None = None, registry: Registry | None = None) -> None:
    """Whether there is such a backend and it takes these options, without opening it; as in `open_backend`."""
    registry = registry or installed()
    name, own, _ = _parted(spec, options, registry)
    registry.configure("backend", name, own)


def _parted(spec: str, options: Given | None, registry: Registry) -> tuple[str, dict[str, Any], BackendOptions]:
    """The backend's name, its own options, and those that go around it."""
    name, colon, model = spec.partition(":")
    if colon and not model:
        raise BsaError(f'the backend "{spec}" names no model behind its colon.', f"write {name}:MODEL.")
    try:
        registry.find("backend", name)
    except BsaError as error:
        hint = f"{error.hint} litellm:PROVIDER/MODEL takes any model that litellm knows."
        raise BsaError(error.message, hint) from None
    said = options.model_dump(exclude_unset=True) if isinstance(options, BackendOptions) else dict(options or {})
    given = {**said, "model": model} if model else said
    try:
        around = BackendOptions.model_validate({key: value for key, value in given.items() if key in _WRAPPERS})
    except ValidationError as error:
        raise explain(error, "backend options", BackendOptions) from None
    return name, {key: value for key, value in given.items() if key not in _WRAPPERS}, around


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
