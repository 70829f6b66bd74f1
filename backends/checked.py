"""Routes and backends whose answers are checked before anything is built on them."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ..core.contracts.border import Unfit, border
from ..core.contracts.products import instance, reply
from ..core.contracts.registry import Registry, installed
from ..core.errors import BsaError
from ..core.messages import Backend, GivesInOrder, JsonSchema, Message, Reply, TellsMeanwhile
from .route import NotReady, Route


class CheckedBackend:
    """Stands before a backend, and names it in whatever goes wrong there; raises `BsaError` if it is no backend."""

    def __init__(self, inner: Backend, who: str, made_by: str = "its factory") -> None:
        self._inner, self._who = inner, who
        with border(who, made_by):
            if not isinstance(inner, Backend):
                missing = [
                    name for name in ("name", "sees_images", "complete", "close") if getattr(inner, name, None) is None
                ]
                raise Unfit(f"returned {type(inner).__name__}, which lacks {', '.join(missing)}")
            self.name: str = instance(inner.name, str, "gave name = {}")
            """What the model is called."""
            self.sees_images: bool = instance(inner.sees_images, bool, "gave sees_images = {}")
            """Whether images are worth sending."""

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        """See `Backend.complete`."""
        with border(self._who, "complete"):
            return reply(self._inner.complete(messages, schema, seed=seed))

    def tell_meanwhile(self, say: Callable[[str], None]) -> None:
        """See `TellsMeanwhile.tell_meanwhile`."""
        if isinstance(self._inner, TellsMeanwhile):
            with border(self._who, "tell_meanwhile"):
                self._inner.tell_meanwhile(say)

    def pass_over(self) -> None:
        """See `GivesInOrder.pass_over`."""
        if isinstance(self._inner, GivesInOrder):
            with border(self._who, "pass_over"):
                self._inner.pass_over()

    def close(self) -> None:
        """Release what the backend holds."""
        with border(self._who, "close"):
            self._inner.close()


class CheckedRoute:
    """Stands before a route, and names it in whatever goes wrong there.

    Of its ``options`` only those are given that are to be set; ``registry`` is by default that of what is installed.
    Raises `BsaError` if there is no such route, or it cannot be used, or it has no such option.
    """

    def __init__(self, name: str, options: Mapping[str, Any], registry: Registry | None = None) -> None:
        registry = registry or installed()
        self._name, self._has_address = name, options.get("base_url") is not None
        self._who = registry.find("route", name).who
        made = registry.make("route", name, options)
        with border(self._who, "its factory"):
            self._inner = instance(made, Route)  # type: ignore[type-abstract]
            self.takes_base_url = instance(made.takes_base_url, bool, "gave takes_base_url = {}")
            """See `Route`."""
            self.on_own_machines = instance(made.on_own_machines, bool, "gave on_own_machines = {}")
            """See `Route`."""

    def check(self, model: str) -> NotReady | None:
        """See `Route.check`."""
        with border(self._who, "check"):
            found = self._inner.check(model)
            if found is not None:
                instance(found, NotReady)
                instance(found.detail, str, "gave NotReady.detail = {}")
                instance(found.remedy, str, "gave NotReady.remedy = {}")
                instance(found.unreachable, bool, "gave NotReady.unreachable = {}")
            return found

    def open(self, model: str | None, name: str | None = None) -> CheckedBackend:
        """A model by its name under this route; see `Route.open`."""
        if not model:
            raise BsaError(f'the backend "{self._name}" needs a model.', f"write {self._name}:MODEL.")
        if self._has_address and not self.takes_base_url:
            hint = f"write openai:{model} for a server at an address of your own."
            raise BsaError(f"--base-url does not go with {self._name}:{model}.", hint)
        with border(self._who, "open"):
            backend = self._inner.open(model, name or f"{self._name}:{model}")
        return CheckedBackend(backend, self._who, "open")
