"""Which environment variables hold the keys of hosted models. The keys themselves are never kept."""

from __future__ import annotations

import os

_KEYS: dict[str, tuple[str, ...]] = {
    "azure": ("AZURE_API_KEY",),
    "bedrock": ("AWS_ACCESS_KEY_ID", "AWS_BEARER_TOKEN_BEDROCK", "AWS_PROFILE"),
    "fireworks_ai": ("FIREWORKS_AI_API_KEY", "FIREWORKS_API_KEY"),
    "gemini": ("GEMINI_API_KEY", "GOOGLE_API_KEY"),
    "huggingface": ("HF_TOKEN", "HUGGINGFACE_API_KEY"),
    "together_ai": ("TOGETHERAI_API_KEY", "TOGETHER_API_KEY", "TOGETHER_AI_API_KEY"),
    "vertex_ai": ("GOOGLE_APPLICATION_CREDENTIALS",),
}
OWN_SERVER_KEY = "BSA_API_KEY"
"""Key for a server reached by ``--base-url``. A provider's key is never sent to such an address."""


def key_variables(provider: str) -> tuple[str, ...]:
    """The variables that may hold a provider's key, the usual one first."""
    return _KEYS.get(provider, (f"{provider.upper()}_API_KEY",))


def has_key(provider: str) -> bool:
    """Whether the environment holds a key for the provider."""
    return any(os.environ.get(name) for name in key_variables(provider))


def provider_of(model: str) -> str:
    """The provider in litellm's ``PROVIDER/MODEL``; OpenAI where none is named."""
    provider, slash, _ = model.partition("/")
    return provider if slash else "openai"
