"""What can be set for a language model, whichever it is."""

from pathlib import Path
from typing import Any, Literal
from urllib.parse import urlsplit

from pydantic import BaseModel, Field, field_validator

REPLY_TOKENS, REPLY_TOKENS_REASONING = 4096, 32768
"""Longest reply where none is set, and that of a hosted model that reasons, whose thoughts count."""


class BackendOptions(BaseModel, extra="forbid", frozen=True):
    """Options of a backend. They are written to the journal, so none of them may hold a key."""

    model: str | None = Field(None, description="The model; usually written behind the colon of --backend ROUTE:MODEL.")
    via: str | None = Field(None, description="Route to a preset's model; without it the first ready route is used.")
    base_url: str | None = Field(
        None, description="Address of an OpenAI-compatible or Ollama server, as http://127.0.0.1:8000/v1."
    )
    temperature: float | None = Field(
        None, ge=0.0, le=2.0, description="Sampling temperature; the model's own if unset."
    )
    max_reply_tokens: int | None = Field(
        None,
        ge=16,
        description=f"Longest reply in tokens; {REPLY_TOKENS} if unset, {REPLY_TOKENS_REASONING} for hosted models "
        "that reason.",
    )
    reasoning_effort: Literal["low", "medium", "high"] | None = Field(
        None, description="How long a reasoning model may think; the model's own if unset."
    )
    timeout_s: float | None = Field(
        None, gt=0, description="Longest wait for one answer in seconds; 300 for servers and none in-process if unset."
    )
    retry_limit_s: float = Field(
        600.0, ge=0, description="After this many seconds of failed attempts a call is given up and its round is lost."
    )
    tool_calls: bool = Field(
        False, description="Whether actions are offered as tools to call, where the route and the model have them."
    )
    sees_images: bool | None = Field(
        None, description="Whether the model is shown overlay images; found out from the route if unset."
    )
    quantisation: Literal["auto", "4bit", "none"] = Field(
        "auto", description="In-process weights: 4-bit by bitsandbytes; auto does so only where 16 bits do not fit."
    )
    exchange: Path | None = Field(
        None, description="Folder in which backend manual leaves prompt-NNN.json and waits for reply-NNN.txt."
    )
    votes: int = Field(1, ge=1, le=99, description="Independent replies asked for and merged in each round.")
    review: bool = Field(False, description="Whether a person accepts, edits or refuses each proposal first.")

    @field_validator("base_url")
    @classmethod
    def _holds_no_key(cls, address: str | None) -> str | None:
        if address is None:
            return None
        parts = urlsplit(address)
        if parts.scheme not in ("http", "https") or not parts.hostname:
            raise ValueError("an address starts with http:// or https://")
        if parts.port == 0:
            raise ValueError("a port is a number from 1 to 65535")
        if parts.username or parts.password or parts.query or parts.fragment:
            raise ValueError(
                "an address holds no user name, key or query; a key belongs into the environment (BSA_API_KEY)"
            )
        return address.rstrip("/")

    @property
    def server_timeout_s(self) -> float:
        """Longest wait for a server's answer in seconds."""
        return 300.0 if self.timeout_s is None else self.timeout_s

    @property
    def route(self) -> str | None:
        """The route that a preset is to be asked by, if any: an address alone means an OpenAI-compatible server."""
        return self.via or (None if self.base_url is None else "openai")

    def for_route(self, route: str) -> dict[str, Any]:
        """What is set here, as options of one of a preset's routes: the address is for the route that it means."""
        about_the_preset = {"via", "model"} if route == self.route else {"via", "model", "base_url"}
        return self.model_dump(exclude_unset=True, exclude=about_the_preset)
