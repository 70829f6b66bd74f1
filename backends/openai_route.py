"""Any OpenAI-compatible server by its address: vLLM, llama.cpp, ``transformers serve``."""

from collections.abc import Mapping

from ..core.errors import BsaError
from .addresses import openai_address, shown
from .api_keys import openai_server_key
from .litellm_route import LiteLLMBackend
from .looking import look
from .route import NotReady, Route


class OpenAIRoute(Route):
    """The server at ``--base-url``, or the one named by ``OPENAI_BASE_URL``."""

    takes_base_url = True

    def check(self, model: str) -> NotReady | None:
        """Whether the server answers and lists the model."""
        address = openai_address(self.options.base_url)
        if address is None:
            return NotReady("no server named", f"vllm serve {model}  # then --base-url http://127.0.0.1:8000/v1")
        seen = look(f"{address}/models", self._key(address))
        if seen.problem:
            detail = f"{shown(address)}: {seen.problem}"
            return NotReady(detail, seen.remedy or f"vllm serve {model}", unreachable=seen.unreachable)
        listed = seen.content.get("data") if isinstance(seen.content, Mapping) else None
        served = [str(item.get("id")) for item in listed or [] if isinstance(item, Mapping)]
        if served and model not in served:
            return NotReady(f"{shown(address)} serves {', '.join(served[:3])}", f"vllm serve {model}")
        return None

    def open(self, model: str, name: str) -> LiteLLMBackend:
        """See `Route.open`."""
        address = openai_address(self.options.base_url)
        if address is None:
            raise BsaError(
                f"openai:{model} needs the address of a server.",
                f"add --base-url http://127.0.0.1:8000/v1, or write litellm:openai/{model} for OpenAI itself.",
            )
        return LiteLLMBackend(model, self.options, name, address, self._key(address))

    def _key(self, address: str) -> str:
        return openai_server_key(address, by_option=self.options.base_url is not None)
