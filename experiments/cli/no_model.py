"""Says that no language model answers, once something asks for one."""

from collections.abc import Callable, Sequence

from ...core.messages import Backend, JsonSchema, Message, Reply
from ...core.run.recording import BackendAround, Recorder

NO_MODEL = (
    "No language model: the rules backend reasons from the prompt alone. "
    "Choose a model with --backend NAME; bsa doctor shows which are ready here."
)


class NoModelTold(BackendAround):
    """The rules backend, which tells at its first call what it is; of a scaffold that never asks nothing is told."""

    def __init__(self, inner: Backend, say: Callable[[str], None]) -> None:
        super().__init__(inner)
        self._say = say
        self._told = False

    def recorded_by(self, recorder: Recorder) -> Backend:
        """See `bsa.core.run.recording.Layer`: inside may be votes and reviews."""
        return NoModelTold(recorder.around(self._inner), self._say)

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        """See `Backend.complete`."""
        if not self._told:
            self._told = True
            self._say(NO_MODEL)
        return self._inner.complete(messages, schema, seed=seed)
