"""The built-in backends. Factories import their libraries when called, so that listing stays fast."""

from collections.abc import Iterable
from functools import partial
from importlib import import_module

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
    yield Entry("random-advice", RandomAdvice, "Answers at random, to measure what bad advice costs.", api=1)
    yield Entry(
        "adversarial-advice",
        AdversarialAdvice,
        "Sends the search into corners, to measure what bad advice costs.",
        api=1,
    )
    yield Entry("replay", _replay, "replay:RUN, the replies of an earlier run, without a model.", BackendOptions, api=1)
    yield Entry(
        "manual",
        _manual,
        "A person or another program, at the terminal or by files (--exchange).",
        BackendOptions,
        api=1,
    )


_ROUTES = (
    ("openai", ".openai_route", "OpenAIRoute", "MODEL of an OpenAI-compatible server at --base-url (vLLM, llama.cpp)."),
    ("ollama", ".ollama_route", "OllamaRoute", "MODEL of an Ollama server."),
    (
        "transformers",
        ".transformers_route",
        "TransformersRoute",
        "FOLDER_OR_NAME, a Hugging Face model in this process.",
    ),
    ("litellm", ".litellm_route", "LiteLLMRoute", "PROVIDER/MODEL, any hosted model that litellm knows."),
)
"""The ways to language models: name, module, class, and what is written behind the name and a colon."""


@hookimpl
def bsa_routes() -> Iterable[Entry]:
    """The ways to language models."""
    for name, module, kind, written in _ROUTES:
        yield Entry(name, partial(_route, module, kind), f"{name}:{written}", BackendOptions, api=1)


def _route(module: str, name: str, options: BackendOptions) -> Route:
    made: Route = getattr(import_module(module, __package__), name)(options)
    return made


def _replay(options: BackendOptions) -> Backend:
    from .replay import replay

    if not options.model:
        raise BsaError('the backend "replay" needs a run.', "write replay:RUN, the folder of an earlier run.")
    return replay(options.model)


def _manual(options: BackendOptions) -> Backend:
    from .manual import ExchangeBackend, TerminalBackend

    if options.model:
        raise BsaError(
            'the backend "manual" has no models.', f"--backend manual --exchange {options.model} names a folder."
        )
    if options.exchange is not None:
        return ExchangeBackend(options.exchange, options.timeout_s)
    return TerminalBackend()
