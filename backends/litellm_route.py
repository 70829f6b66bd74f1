"""Hosted models through litellm."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from typing import Any

import httpx

from ..core.errors import BsaError
from ..core.messages import Message, StructuredBy, Usage
from .addresses import shown
from .api_keys import OWN_SERVER_KEY, has_key, key_remedy, key_variables, provider_of
from .bounded_http import BoundedTransport, OwnServerTransport
from .images import data_urls
from .options import REPLY_TOKENS, REPLY_TOKENS_REASONING, BackendOptions
from .prompt_fitting import ContextTooSmallError
from .reaching import connection_failure, in_short
from .retrying import TransientError, retry_after
from .route import NotReady, Route
from .served import Answer, Request, ServedBackend
from .strict_schema import strict, without_nulls
from .structured_output import FormRefusedError
from .tool_calls import as_object, tools


class LiteLLMRoute(Route):
    """Hosted models by litellm's names."""

    def check(self, model: str) -> NotReady | None:
        """Whether there is a key for the provider."""
        provider = provider_of(model)
        if has_key(provider):
            return None
        return NotReady(f"no key for {provider}", f"export {key_variables(provider)[0]}=...")

    def open(self, model: str, name: str) -> LiteLLMBackend:
        """See `Route.open`."""
        return LiteLLMBackend(model if "/" in model else f"{provider_of(model)}/{model}", self.options, name)


@cache
def _litellm() -> Any:
    # The price list comes with the package; without this it is fetched from the network on import.
    os.environ.setdefault("LITELLM_LOCAL_MODEL_COST_MAP", "True")
    # Otherwise litellm reads keys from a file .env; here the environment is the only source.
    os.environ.setdefault("LITELLM_MODE", "PRODUCTION")
    import litellm

    transport = BoundedTransport()
    litellm.client_session = httpx.Client(transport=transport)  # for what goes through the clients of openai
    litellm.sync_transport = transport  # for everything else
    litellm.telemetry = False
    litellm.suppress_debug_info = True
    for name in ("LiteLLM", "LiteLLM Proxy", "LiteLLM Router", "httpx"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    return litellm


class LiteLLMBackend(ServedBackend):
    """A model that litellm can reach.

    ``model`` is litellm's name, ``PROVIDER/MODEL``; with ``base_url`` the name that the server uses. ``key_variable``
    is the environment variable with the key for that server.
    """

    def __init__(
        self,
        model: str,
        options: BackendOptions,
        name: str,
        base_url: str | None = None,
        key_variable: str = OWN_SERVER_KEY,
    ) -> None:
        super().__init__(name, f"litellm {shown(base_url or '')} {model}", options)
        self._litellm = _litellm()
        self._model = f"openai/{model}" if base_url else model
        self._base_url = base_url
        self._key_variable = key_variable
        self._price_known = True
        self._provider = "openai" if base_url else self._find_provider()
        seen = self._knows(self._litellm.supports_vision)
        self.sees_images = bool(seen) if options.sees_images is None else options.sees_images
        self._reasons = self._knows(self._litellm.supports_reasoning)
        if base_url is None:
            self._check_key()
            self.strictest = self._find_strictest()
        if options.tool_calls and (base_url is not None or self._knows(self._litellm.supports_function_calling)):
            self.strictest = "tools"

    def _find_provider(self) -> str:
        try:
            return str(self._litellm.get_llm_provider(self._model)[1])
        except Exception:
            raise BsaError(
                f'litellm does not know the model "{self._model}".',
                "write litellm:PROVIDER/MODEL, as litellm:openai/o3.",
            ) from None

    def _check_key(self) -> None:
        found = self._litellm.validate_environment(self._model)
        missing = list(found.get("missing_keys") or ())
        if not found.get("keys_in_environment") and missing and not has_key(self._provider):
            raise BsaError(
                f'the model "{self._model}" needs the environment variable {" and ".join(missing)}.',
                f"export {missing[0]}=...",
            )

    def _knows(self, question: Callable[[str], bool]) -> bool:
        # litellm answers for the models in its list only, and raises for some others.
        with suppress(Exception):
            return bool(question(self._model))
        return False

    def _find_strictest(self) -> StructuredBy:
        """What the model takes as litellm knows it; litellm drops silently what it thinks unsupported."""
        supported: list[str] = []
        with suppress(Exception):
            supported = self._litellm.get_supported_openai_params(self._model) or []
        if "response_format" not in supported:
            return "text"
        return "schema" if self._knows(self._litellm.supports_response_schema) else "json"

    def ask(self, request: Request, notes: list[str]) -> Answer:
        """See `ServedBackend.ask`."""
        try:
            response = self._litellm.completion(**self._arguments(request))
            return self._answer(response, request.form, notes)
        except FormRefusedError:
            raise
        except Exception as error:
            # Without the cause: litellm's tracebacks hold the request, headers included.
            raise self._translated(error) from None

    def _arguments(self, request: Request) -> dict[str, Any]:
        usual = REPLY_TOKENS_REASONING if self._reasons else REPLY_TOKENS
        reply_tokens = self.options.max_reply_tokens or usual
        arguments: dict[str, Any] = {
            "model": self._model,
            "messages": [_as_openai(message) for message in request.messages],
            "max_tokens": reply_tokens,
            "seed": request.seed,
            "timeout": request.timeout_s,
            "max_retries": 0,
            "num_retries": 0,
            "drop_params": True,
        }
        if self.options.temperature is not None:
            arguments["temperature"] = self.options.temperature
        if self.options.reasoning_effort is not None:
            arguments["reasoning_effort"] = self.options.reasoning_effort
        if self._base_url is not None:
            arguments |= {"api_base": self._base_url, "client": self._own_client(self._base_url)}
        if request.form == "tools":
            arguments |= {"tools": tools(request.schema, self._base_url is None), "tool_choice": "required"}
        elif request.form == "schema":
            # Servers of one's own enforce more of JSON Schema than the hosted models' strict subset.
            schema = dict(request.schema) if self._base_url else strict(request.schema)
            arguments["response_format"] = {
                "type": "json_schema",
                "json_schema": {"name": "proposal", "schema": schema, "strict": True},
            }
        elif request.form == "json":
            arguments["response_format"] = {"type": "json_object"}
        return arguments

    def _own_client(self, address: str) -> Any:
        import openai

        transport = OwnServerTransport(os.environ.get(self._key_variable))
        # The client wants some key, and would take OPENAI_API_KEY; the transport sends the right one.
        return openai.OpenAI(base_url=address, api_key="none", http_client=httpx.Client(transport=transport))

    def _answer(self, response: Any, form: StructuredBy, notes: list[str]) -> Answer:
        choice = response.choices[0]
        text = choice.message.content
        text = text if isinstance(text, str) else ""
        if form == "tools":
            called = getattr(choice.message, "tool_calls", None)
            if not called:
                raise FormRefusedError("the model called none", certain=False, usage=self._usage(response, notes))
            text = as_object(str(called[0].function.name), str(called[0].function.arguments))
        if form in ("tools", "schema") and self._base_url is None:
            text = without_nulls(text)
        return Answer(
            text=text,
            model=str(getattr(response, "model", "") or self._model),
            usage=self._usage(response, notes),
            cut=getattr(choice, "finish_reason", "") == "length",
        )

    def _usage(self, response: Any, notes: list[str]) -> Usage:
        counts = getattr(response, "usage", None)
        details = getattr(counts, "completion_tokens_details", None)
        cost = None
        with suppress(Exception):
            cost = self._litellm.completion_cost(completion_response=response, model=self._model)
        if not cost and self._price_known:
            notes.append(f"the price of {self._model} is not known")
            self._price_known = False
        return Usage(
            prompt_tokens=_count(counts, "prompt_tokens"),
            completion_tokens=_count(counts, "completion_tokens"),
            reasoning_tokens=_count(details, "reasoning_tokens"),
            cost_usd=float(cost) if cost else None,
        )

    def _translated(self, error: Exception) -> Exception:
        litellm = self._litellm
        status = getattr(error, "status_code", None)
        reason = in_short(error)
        where = shown(self._base_url) if self._base_url else self._provider
        failure = connection_failure(error)
        if failure is not None:
            return failure
        if isinstance(error, litellm.ContextWindowExceededError):
            return ContextTooSmallError()
        if status in (401, 403):
            variable = self._key_variable if self._base_url else key_variables(self._provider)[0]
            return BsaError(f"{where} did not accept the key ({reason}).", key_remedy(variable))
        if "insufficient_quota" in str(error) or status == 402:
            return BsaError(f"{where} says that the account has no credit left.", "top it up, or choose another --via.")
        if status == 404:
            hint = _not_found(self._base_url) if self._base_url else "check the model's name and your access to it."
            return BsaError(f'{where} does not know "{self._model.removeprefix("openai/")}" ({reason}).', hint)
        if isinstance(error, litellm.RateLimitError):
            return TransientError(reason, retry_after(_headers(error)))
        if status == 500 and "response_format" in str(error):
            return FormRefusedError(reason)  # llama-cpp-python's server says so of a form that it does not know
        if status in (400, 413, 415, 422, 501) and not isinstance(error, litellm.Timeout):
            return ContextTooSmallError() if _speaks_of_context(str(error)) else FormRefusedError(reason)
        return TransientError(reason, retry_after(_headers(error)), server_fault=status == 500)


def _not_found(address: str) -> str:
    """What to do about HTTP status 404 of a server of one's own."""
    if not address.endswith("/v1"):
        return "does the address end in /v1?"
    return f"check the model's name: curl {shown(address)}/models lists what the server has."


def _as_openai(message: Message) -> dict[str, Any]:
    if not message.images:
        return {"role": message.role, "content": message.text}
    pictures = [{"type": "image_url", "image_url": {"url": url}} for url in data_urls(message)]
    return {"role": message.role, "content": [{"type": "text", "text": message.text}, *pictures]}


def _count(counts: Any, name: str) -> int:
    value = getattr(counts, name, 0)
    return value if isinstance(value, int) and value > 0 else 0


def _headers(error: Exception) -> Any:
    headers = getattr(error, "litellm_response_headers", None)
    return headers if headers is not None else getattr(getattr(error, "response", None), "headers", None)


def _speaks_of_context(text: str) -> bool:
    folded = text.casefold()
    return "context" in folded and any(word in folded for word in ("length", "window", "size", "exceed", "maximum"))
