"""From what is written behind ``--backend`` to a backend."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ..core.contracts.registry import Registry, installed
from ..core.errors import BsaError
from ..core.messages import Backend
from ..core.validation import validated
from .checked import CheckedBackend, CheckedRoute
from .options import BackendOptions
from .presets import Preset, load_presets

_WRAPPERS = {"votes", "review"}
"""Options that stand around any backend and are none of its own."""


def open_backend(spec: str, options: Mapping[str, Any] | None = None, registry: Registry | None = None) -> Backend:
    """Open a language model.

    ``spec`` is ``NAME`` or ``NAME:MODEL``: a preset (``qwen2.5-14b``), a route and its model (``litellm:openai/o3``,
    ``openai:my-model``, ``ollama:qwen2.5:14b``, ``transformers:PATH``, ``replay:RUN``), ``manual``, ``rules``, or what
    a third party offers. Of its options only those are given that are to be set, and they are checked against its
    ``config_type``; ``votes`` and ``review`` go with any backend, which is wrapped for them. ``registry`` is by default
    that of what is installed.

    Raises `BsaError` if there is no such backend, it has no such option, or it is not ready; the hint says what would
    make it so.
    """
    registry = registry or installed()
    name, own, around = _parted(spec, options, registry)
    backend: Backend
    if name in registry.names("route"):
        backend = CheckedRoute(name, own, registry).open(own.get("model"))
    else:
        backend = CheckedBackend(registry.make("backend", name, own), registry.find("backend", name).who)
    if around.votes > 1:
        from .voting import VotingBackend

        backend = VotingBackend(backend, around.votes)
    if around.review:
        from .reviewing import ReviewingBackend

        backend = ReviewingBackend(backend)
    return backend


def check_backend(spec: str, options: Mapping[str, Any] | None = None, registry: Registry | None = None) -> None:
    """Whether there is such a backend and it takes these options, without opening it; as in `open_backend`."""
    registry = registry or installed()
    name, own, _ = _parted(spec, options, registry)
    registry.configure("backend", name, own)


def look_before(spec: str, options: Mapping[str, Any] | None = None) -> str:
    """Look for a second at most whether a model can be asked; a note where that is not certain, else nothing.

    Presets were looked at when they were opened, and what is no route is always there. Raises `BsaError` if nothing is
    there that could answer; the hint says what would change that.
    """
    from .looking import forget_looks

    registry = installed()
    name, own, _ = _parted(spec, options, registry)
    if name not in registry.names("route") or own.get("model") is None:
        return ""
    forget_looks()
    route = CheckedRoute(name, own, registry)
    try:
        obstacle = route.check(own["model"])
    except BsaError:
        return ""  # A look that fails says nothing of the model.
    if obstacle is None or obstacle.made_ready_by_opening:
        return ""
    if obstacle.unreachable:
        raise BsaError(f"the model {spec} cannot be asked: {obstacle.detail}.", obstacle.remedy)
    # A service is opened with its key, or not at all.
    if not (route.on_own_machines or route.takes_base_url):
        return ""
    return f"The model {spec} may not answer: {obstacle.detail}. What would help: {obstacle.remedy}"


def ready_backend(spec: str, options: Mapping[str, Any], begun: bool) -> tuple[Backend, str]:
    """A model that was opened and looked at, and a note where it may not answer.

    A run that was ``begun`` is not looked at: its journal may hold every reply that it needs. Raises `BsaError` if it
    cannot be opened, or nothing is there that could answer.
    """
    backend = open_backend(spec, options)
    if begun:
        return backend, ""
    try:
        return backend, look_before(spec, options)
    except BaseException:
        backend.close()
        raise


def _parted(
    spec: str, options: Mapping[str, Any] | None, registry: Registry
) -> tuple[str, dict[str, Any], BackendOptions]:
    """The backend's name, its own options, and those that go around it."""
    name, colon, model = spec.partition(":")
    if colon and not model:
        raise BsaError(f'the backend "{spec}" names no model behind its colon.', f"write {name}:MODEL.")
    try:
        listing = registry.find("backend", name)
    except BsaError as error:
        hint = f"{error.hint} litellm:PROVIDER/MODEL takes any model that litellm knows."
        raise BsaError(error.message, hint) from None
    given = {**(options or {}), "model": model} if model else dict(options or {})
    around = validated(
        BackendOptions, {key: value for key, value in given.items() if key in _WRAPPERS}, "backend options"
    )
    if given.get("base_url") is not None and "base_url" not in listing.entry.config_type.model_fields:
        raise BsaError(
            f"--base-url does not go with the backend {spec}.",
            "leave it out, or write openai:MODEL for a server at an address of your own.",
        )
    if issubclass(listing.entry.config_type, BackendOptions):
        _check_way(spec, name, given, listing.own, registry)
    return name, {key: value for key, value in given.items() if key not in _WRAPPERS}, around


def _check_way(spec: str, name: str, given: Mapping[str, Any], own: bool, registry: Registry) -> None:
    """Refuse a route or an exchange folder where the backend would ignore it; what others offer may use them."""
    via, is_route = given.get("via"), name in registry.names("route")
    if via is not None:
        registry.find("route", str(via))
        if via != name and (is_route or (own and name not in load_presets())):
            raise BsaError(
                f"--via does not go with the backend {spec}.",
                "leave it out, or name a preset, which has several routes: bsa list backends.",
            )
    if given.get("exchange") is not None and (own or is_route) and name != "manual":
        raise BsaError(f"--exchange does not go with the backend {spec}.", "leave it out, or write --backend manual.")


def open_preset(preset: Preset, options: BackendOptions) -> Backend:
    """A preset's model by ``options.via``, or by the first route that is ready.

    Raises `BsaError` if the preset has no such route, or none is ready; the hint names the way to each.
    """
    from .looking import forget_looks
    from .readiness import check_preset

    if options.model is not None:
        raise BsaError(f'"{preset.name}" names its model itself.', f"leave out :{options.model}.")
    if options.route is not None and options.route not in preset.models:
        raise BsaError(
            f'"{preset.name}" cannot be reached via {options.route}.', f"its routes are {', '.join(preset.models)}."
        )
    wanted = {route: models for route, models in preset.models.items() if options.route in (None, route)}
    for route in wanted:
        try:
            installed().find("route", route)
        except BsaError as error:
            raise BsaError(f'{preset.file}: preset "{preset.name}": {error.message}', error.hint) from None
    forget_looks()
    found = check_preset(replace(preset, models=wanted), options)
    ready = next((item for item in found if item.ready), None)
    if ready is None and options.via is not None and found[0].made_ready_by_opening:
        ready = found[0]
    if ready is None:
        ways = "; ".join(f"{item.route} ({item.detail}): {item.remedy}" for item in found)
        raise BsaError(f'the model "{preset.name}" is not ready on this machine.', ways)
    chosen = CheckedRoute(ready.route, options.for_route(ready.route))
    return chosen.open(ready.model, f"{preset.name} via {ready.route}")


def on_own_machines(spec: str, options: Mapping[str, Any]) -> bool:
    """Whether a backend's models run on machines of the user, so that their tokens cost nothing."""
    route = str(options.get("via") or spec.partition(":")[0])
    return route in installed().names("route") and CheckedRoute(route, {}).on_own_machines
