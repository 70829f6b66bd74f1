"""The built-in backends. Factories import their libraries when called, so that listing stays fast."""

from collections.abc import Iterable
from functools import partial

from ..core.errors import BsaError
from ..core.hooks import Entry, hookimpl
from ..core.messages import Backend
from .opening import open_preset
from .options import BackendOptions
from .presets import load_presets
from .route import Route


@hookimpl
def bsa_backends() -> Iterable[Entry]:
    """Everything that answers behind the one method of `Backend`."""
    from .bad_advice import AdversarialAdvice, RandomAdvice
    from .rules.backend import RulesBackend

    yield Entry("rules", RulesBackend, "A deterministic reasoner that reads the prompt; needs no model.", api=1)
    for name, preset in load_presets().items():
        yield Entry(name, partial(open_preset, preset), preset.summary, BackendOptions, api=1)
    yield Entry("random-advice", RandomAdvice, "Answers at random, for measuring what bad advice costs.", api=1)
    yield Entry("adversarial-advice", AdversarialAdvice, "Sends the search into corners, for the same purpose.", api=1)
    yield Entry("replay", _replay, "replay:RUN, the replies of an earlier run, without a model.", BackendOptions, api=1)
    yield Entry(
        "manual",
        _manual,
        "A person or another program, at the terminal or by files (--exchange).",
        BackendOptions,
        api=1,
    )


@hookimpl
def bsa_routes() -> Iterable[Entry]:
    """The ways to language models."""
    yield Entry(
        "openai",
        _openai,
        "openai:MODEL of an OpenAI-compatible server at --base-url (vLLM, llama.cpp).",
        BackendOptions,
        api=1,
    )
    yield Entry("ollama", _ollama, "ollama:MODEL of an Ollama server.", BackendOptions, api=1)
    yield Entry(
        "transformers",
        _transformers,
        "transformers:FOLDER_OR_NAME, a Hugging Face model in this process.",
        BackendOptions,
        api=1,
    )
    yield Entry(
        "litellm", _litellm, "litellm:PROVIDER/MODEL, any hosted model that litellm knows.", BackendOptions, api=1
    )


def _openai(options: BackendOptions) -> Route:
    from .openai_route import OpenAIRoute

    return OpenAIRoute(options)


def _ollama(options: BackendOptions) -> Route:
    from .ollama_route import OllamaRoute

    return OllamaRoute(options)


def _transformers(options: BackendOptions) -> Route:
    from .transformers_route import TransformersRoute

    return TransformersRoute(options)


def _litellm(options: BackendOptions) -> Route:
    from .litellm_route import LiteLLMRoute

    return LiteLLMRoute(options)


def _replay(options: BackendOptions) -> Backend:
    from .replay import replay

    if not options.model:
        raise BsaError('the backend "replay" needs a run.', "write replay:RUN, the folder of an earlier run.")
    return replay(options.model)


def _manual(options: BackendOptions) -> Backend:
    from .manual import ExchangeBackend, TerminalBackend

    if options.exchange is not None:
        return ExchangeBackend(options.exchange, options.timeout_s)
    return TerminalBackend()
