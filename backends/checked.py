"""A backend whose answers are checked before anything is built on them."""

from __future__ import annotations

from collections.abc import Sequence

from ..core.border import Unfit, border
from ..core.messages import Backend, JsonSchema, Message, Reply
from ..core.products import instance, reply


class CheckedBackend:
    """Stands before a backend, and names it in whatever goes wrong there.

    Parameters
    ----------
    inner : Backend
        The backend.
    who : str
        Kind, name, distribution and version.

    Raises
    ------
    BsaError
        If it is no backend.
    """

    def __init__(self, inner: Backend, who: str) -> None:
        self._inner, self._who = inner, who
        with border(who, "its factory"):
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

    def close(self) -> None:
        """Release what the backend holds."""
        with border(self._who, "close"):
            self._inner.close()
