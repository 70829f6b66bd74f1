"""Models of an Ollama server, through its official client."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from shutil import which
from typing import Any

from ..core.errors import BsaError
from ..core.messages import Message, Usage
from .addresses import ollama_address, shown
from .api_keys import OLLAMA_KEY, OWN_SERVER_KEY, ollama_server_key
from .bounded_http import OwnServerTransport
from .looking import look
from .options import REPLY_TOKENS, BackendOptions
from .prompt_fitting import ContextTooSmallError
from .reaching import connection_failure, in_short
from .retrying import TransientError, UnreachableError
from .route import NotReady, Route
from .served import Answer, Request, ServedBackend
from .structured_output import FormRefusedError

_CONTEXT_STEP = 4096
# English and JSON take about four characters a token; numbers take fewer.
_CHARS_PER_TOKEN = 2.5
_TOKENS_PER_IMAGE = 1500
_LOOK_UP_TIMEOUT_S = 10.0


class OllamaRoute(Route):
    """The server at ``--base-url``, else at ``OLLAMA_HOST``, else on this machine."""

    takes_base_url = True
    on_own_machines = True

    def check(self, model: str) -> NotReady | None:
        """Whether the server answers and holds the model."""
        address = ollama_address(self.options.base_url)
        key = ollama_server_key(address, by_option=self.options.base_url is not None)
        seen = look(f"{address}/api/tags", key)
        if seen.problem:
            remedy = "ollama serve" if which("ollama") else "install Ollama (https://ollama.com/download)"
            return NotReady(f"Ollama {seen.problem}", seen.remedy or remedy, unreachable=seen.unreachable)
        listed = seen.content.get("models") if isinstance(seen.content, Mapping) else None
        held = {str(item.get("model") or item.get("name")) for item in listed or [] if isinstance(item, Mapping)}
        if not {model, f"{model}:latest"} & held:
            return NotReady("Ollama does not hold it", f"ollama pull {model}")
        return None

    def open(self, model: str, name: str) -> OllamaBackend:
        """See `Route.open`."""
        return OllamaBackend(model, self.options, name)


class OllamaBackend(ServedBackend):
    """A model that an Ollama server holds, by Ollama's name: ``qwen2.5:14b``.

    The server's address is ``base_url``; without it ``OLLAMA_HOST`` or this machine. Raises `BsaError` if no server
    listens, or it does not hold the model.
    """

    def __init__(self, model: str, options: BackendOptions, name: str) -> None:
        import ollama

        self._address = ollama_address(options.base_url)
        self._key_variable = ollama_server_key(self._address, by_option=options.base_url is not None)
        super().__init__(name, f"ollama {shown(self._address)} {model}", options)
        self._ollama = ollama
        self._model = model
        capabilities, self._context_tokens = self._look_up()
        self.sees_images = "vision" in capabilities if options.sees_images is None else options.sees_images
        self._thinks = "thinking" in capabilities

    def _client(self, timeout_s: float) -> Any:
        # Ollama's client adds OLLAMA_API_KEY for any address; the transport sends what belongs there.
        transport = OwnServerTransport(os.environ.get(self._key_variable or ""))
        return self._ollama.Client(host=self._address, timeout=timeout_s, transport=transport)

    def _look_up(self) -> tuple[list[str], int | None]:
        """Capabilities and longest context of the model."""
        try:
            found = self._client(_LOOK_UP_TIMEOUT_S).show(self._model)
        except Exception as error:
            raise self._unusable(error) from None
        information = found.modelinfo or {}
        lengths = [value for key, value in information.items() if key.endswith(".context_length")]
        context = lengths[0] if lengths and isinstance(lengths[0], int) and lengths[0] > 0 else None
        return list(found.capabilities or ()), context

    def _unusable(self, error: Exception) -> BsaError:
        reason = in_short(error)
        if isinstance(error, self._ollama.ResponseError) and error.status_code == 404:
            return BsaError(f'Ollama does not hold the model "{self._model}".', f"ollama pull {self._model}")
        failure = connection_failure(error)
        if isinstance(failure, UnreachableError):
            return BsaError(
                f"Ollama does not answer: {failure.what}.", f"{failure.hint}; ollama serve starts one here."
            )
        return BsaError(f"Ollama does not answer ({reason}).", "ollama serve")

    def ask(self, request: Request, notes: list[str]) -> Answer:
        """See `ServedBackend.ask`."""
        # A short context is shared with the prompt.
        usual = REPLY_TOKENS if self._context_tokens is None else min(REPLY_TOKENS, self._context_tokens // 2)
        reply_tokens = self.options.max_reply_tokens or usual
        options: dict[str, Any] = {
            "seed": request.seed,
            "num_predict": reply_tokens,
            "num_ctx": self._context(request.messages, reply_tokens),
        }
        if self.options.temperature is not None:
            options["temperature"] = self.options.temperature
        form: Any = {"schema": dict(request.schema), "json": "json", "text": None}[request.form]
        try:
            response = self._client(request.timeout_s).chat(
                model=self._model,
                messages=[_as_ollama(message) for message in request.messages],
                format=form,
                options=options,
                think=self.options.reasoning_effort if self._thinks else None,
                stream=False,
            )
        except Exception as error:
            raise self._translated(error) from None
        return Answer(
            text=response.message.content or "",
            model=response.model or self._model,
            usage=Usage(
                prompt_tokens=max(0, response.prompt_eval_count or 0),
                completion_tokens=max(0, response.eval_count or 0),
            ),
            cut=response.done_reason == "length",
        )

    def _context(self, messages: Sequence[Message], reply_tokens: int) -> int:
        """A context that holds prompt and reply: Ollama cuts what does not fit, and says nothing.

        Rounded up, since the server loads the model anew for each new length.
        """
        characters = sum(len(message.text) for message in messages)
        pictures = sum(len(message.images) for message in messages)
        needed = characters / _CHARS_PER_TOKEN + pictures * _TOKENS_PER_IMAGE + reply_tokens
        context = math.ceil(needed / _CONTEXT_STEP) * _CONTEXT_STEP
        if self._context_tokens is None or context <= self._context_tokens:
            return context
        if needed > self._context_tokens:
            raise ContextTooSmallError
        return self._context_tokens

    def _translated(self, error: Exception) -> Exception:
        reason = in_short(error)
        status = getattr(error, "status_code", None)
        if status == 404:
            return self._unusable(error)
        if status in (401, 403):
            return BsaError(f"the Ollama server did not accept the key ({reason}).", self._key_hint())
        if status in (400, 422, 501):
            return FormRefusedError(reason)
        return connection_failure(error) or TransientError(reason, server_fault=status == 500)

    def _key_hint(self) -> str:
        if self._key_variable is not None:
            return f"export {self._key_variable}=..."
        return f"{OLLAMA_KEY} goes to the server of OLLAMA_HOST, by https; {OWN_SERVER_KEY} goes with --base-url."


def _as_ollama(message: Message) -> dict[str, Any]:
    content: dict[str, Any] = {"role": message.role, "content": message.text}
    if message.images:
        content["images"] = [path.read_bytes() for path in message.images]
    return content
