"""Which models can be asked on this machine, and the one command that would make each of the others ready."""

from dataclasses import dataclass

from ..core.errors import BsaError
from .checked import CheckedRoute
from .options import BackendOptions
from .presets import Preset, load_presets


@dataclass(frozen=True)
class Readiness:
    """Whether a model can be asked by one route."""

    backend: str  # What to write behind ``--backend``.
    route: str
    model: str  # The model's name under that route.
    ready: bool  # Whether it can be asked now.
    detail: str  # Why, or why not.
    remedy: str = ""  # The command that would make it ready; empty if it is.
    made_ready_by_opening: bool = False  # Whether opening it does the same.


def survey() -> list[Readiness]:
    """Every preset by every route, for ``bsa doctor``. Costs a second at most where no server listens."""
    return [found for preset in load_presets().values() for found in check_preset(preset, BackendOptions())]


def check_preset(preset: Preset, options: BackendOptions) -> list[Readiness]:
    """A preset by each of its routes, in its order; of several names under a route the first ready one."""
    found: list[Readiness] = []
    for route, models in preset.models.items():
        checks = [check(preset.name, route, model, options) for model in models]
        found.append(next((item for item in checks if item.ready), checks[0]))
    return found


def check(backend: str, route: str, model: str, options: BackendOptions) -> Readiness:
    """One model by one route. Looks, but never loads or asks a model. A route that fails is not ready."""
    try:
        obstacle = CheckedRoute(route, options.for_route(route)).check(model)
    except BsaError as error:
        return Readiness(backend, route, model, False, error.message, error.hint)
    if obstacle is None:
        return Readiness(backend, route, model, True, "ready")
    return Readiness(backend, route, model, False, obstacle.detail, obstacle.remedy, obstacle.made_ready_by_opening)
