"""Which environment variables hold keys, and which server each may go to. The keys themselves are never kept."""

import os

from .addresses import is_private, ollama_address, origin

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
OPENAI_KEY = "OPENAI_API_KEY"
OLLAMA_KEY = "OLLAMA_API_KEY"
_OLLAMA_CLOUD = "https://ollama.com"


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


def openai_server_key(address: str, by_option: bool) -> str:
    """The variable whose key an OpenAI-compatible server gets.

    ``BSA_API_KEY`` is for whichever server is named. ``OPENAI_API_KEY`` goes along with ``OPENAI_BASE_URL`` alone
    (whoever sets both means that key for that address), and never where it could be read on the way.
    """
    if by_option or os.environ.get(OWN_SERVER_KEY) or not is_private(address):
        return OWN_SERVER_KEY
    return OPENAI_KEY


def ollama_server_key(address: str, by_option: bool) -> str | None:
    """The variable whose key an Ollama server gets, if any.

    ``OLLAMA_API_KEY`` belongs to ollama.com, or to the server that ``OLLAMA_HOST`` names, and is never sent where
    it could be read on the way. Any other server that ``--base-url`` names gets ``BSA_API_KEY``.
    """
    owners = [_OLLAMA_CLOUD] + ([ollama_address()] if os.environ.get("OLLAMA_HOST") else [])
    if is_private(address) and origin(address) in map(origin, owners):
        return OLLAMA_KEY
    return OWN_SERVER_KEY if by_option else None


def key_remedy(variable: str) -> str:
    """What to do where a server did not accept the key of an environment variable, or wants one."""
    if os.environ.get(variable):
        return f"correct the key in {variable}: it was sent, and refused."
    return f"export {variable}=..."
