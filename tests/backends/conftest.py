"""Servers on 127.0.0.1 and a tiny model with random weights, for the tests of backends."""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest
from bsa.backends import structured_output
from bsa.backends.looking import forget_looks
from bsa.core.messages import Message
from bsa.core.proposal import CHANGE_PATTERN

PARAMETERS = ("Electrode height [m]", "Positive particle radius [m]", "Separator porosity")


@pytest.fixture(autouse=True)
def _fresh(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> None:
    """No test sees another's refusals, nor the keys and presets of whoever runs it."""
    structured_output._accepted.clear()
    forget_looks()
    for name in list(os.environ):
        if name.endswith(("_API_KEY", "_BASE_URL")) or name in ("OLLAMA_HOST", "BSA_PRESETS", "HF_TOKEN"):
            monkeypatch.delenv(name)
    for name in ("http_proxy", "https_proxy", "all_proxy", "HTTP_PROXY", "HTTPS_PROXY", "ALL_PROXY"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def schema() -> dict[str, Any]:
    change = {"type": "string", "pattern": CHANGE_PATTERN, "maxLength": 24}
    return {
        "type": "object",
        "properties": {
            "analysis": {"type": "string", "maxLength": 60},
            "hypothesis": {"type": "string", "maxLength": 40},
            "updated_params": {
                "type": "object",
                "properties": dict.fromkeys(PARAMETERS, change),
                "additionalProperties": False,
                "minProperties": 1,
            },
            "rationale": {"type": "string", "maxLength": 40},
        },
        "required": ["analysis", "hypothesis", "updated_params", "rationale"],
        "additionalProperties": False,
    }


@pytest.fixture
def messages() -> list[Message]:
    user = "## Task\nmatch it\n\n## Memory: rounds so far\n[1, 2]\n\n## Memory: priors\n[3]\n\n## What to do\nPropose."
    return [Message("system", "You calibrate."), Message("user", user)]


@pytest.fixture
def proposal() -> dict[str, Any]:
    return {
        "analysis": "too short",
        "hypothesis": "too little area",
        "updated_params": {"Electrode height [m]": "*1.2"},
        "rationale": "more area",
    }


@dataclass
class Seen:
    """What a server was asked."""

    path: str
    body: Any
    headers: dict[str, str]


@dataclass
class Server:
    """A server of canned answers.

    ``answer(seen)`` returns status, headers and content, or acts on the raw connection itself and returns None.
    """

    url: str
    seen: list[Seen] = field(default_factory=list)


Answerer = Callable[[Seen, BaseHTTPRequestHandler], tuple[int, dict[str, str], bytes] | None]


@contextmanager
def _serving(answer: Answerer) -> Iterator[Server]:
    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def handle_any(self) -> None:
            length = int(self.headers.get("content-length") or 0)
            raw = self.rfile.read(length)
            headers = {key.casefold(): value for key, value in self.headers.items()}
            seen = Seen(self.path, json.loads(raw) if raw else None, headers)
            server.seen.append(seen)
            result = answer(seen, self)
            if result is None:
                self.close_connection = True
                return
            status, headers, content = result
            self.send_response(status)
            for name, value in {"content-type": "application/json", **headers}.items():
                self.send_header(name, value)
            self.send_header("content-length", str(len(content)))
            self.end_headers()
            self.wfile.write(content)

        do_GET = do_POST = handle_any  # noqa: N815

        def log_message(self, *args: Any) -> None:
            pass

    class QuietServer(ThreadingHTTPServer):
        daemon_threads = True

        def handle_error(self, *args: Any) -> None:
            pass  # clients that hang up are part of the tests

    listener = QuietServer(("127.0.0.1", 0), Handler)
    server = Server(f"http://127.0.0.1:{listener.server_address[1]}")
    thread = threading.Thread(target=listener.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True)
    thread.start()
    try:
        yield server
    finally:
        listener.shutdown()
        listener.server_close()


@pytest.fixture
def serve() -> Iterator[Callable[[Answerer], Server]]:
    """Starts servers that end with the test."""
    open_servers = []

    def start(answer: Answerer) -> Server:
        context = _serving(answer)
        open_servers.append(context)
        return context.__enter__()

    yield start
    for context in open_servers:
        context.__exit__(None, None, None)


def chat_completion(text: Any, **more: Any) -> bytes:
    """An answer of /v1/chat/completions."""
    content = {
        "id": "1",
        "object": "chat.completion",
        "created": 1,
        "model": "served-model",
        "choices": [{"index": 0, "finish_reason": "stop", "message": {"role": "assistant", "content": text}}],
        "usage": {"prompt_tokens": 11, "completion_tokens": 7, "total_tokens": 18},
    }
    return json.dumps({**content, **more}).encode()


@pytest.fixture(name="chat_completion")
def _chat_completion() -> Callable[..., bytes]:
    return chat_completion


@pytest.fixture(scope="session")
def tiny_model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A two-layer Qwen2 with random weights and a byte-level tokenizer, in Hugging Face format."""
    torch = pytest.importorskip("torch", reason='pip install "battery-sim-agent[local]"')
    transformers = pytest.importorskip("transformers", reason='pip install "battery-sim-agent[local]"')
    pytest.importorskip("llguidance", reason='pip install "battery-sim-agent[local]"')
    from tokenizers import Tokenizer, decoders, models, pre_tokenizers, trainers

    # Its layers take microseconds: on a busy machine threads spend minutes in waiting for one another.
    torch.set_num_threads(1)
    folder = tmp_path_factory.mktemp("tiny-qwen2")
    bytes_first = Tokenizer(models.BPE())
    bytes_first.pre_tokenizer = pre_tokenizers.ByteLevel(add_prefix_space=False)
    bytes_first.decoder = decoders.ByteLevel()
    special = ["<|endoftext|>", "<|im_start|>", "<|im_end|>"]
    trainer = trainers.BpeTrainer(
        vocab_size=400,
        special_tokens=special,
        initial_alphabet=pre_tokenizers.ByteLevel.alphabet(),
        show_progress=False,
    )
    corpus = [name + ' {"analysis": "the capacity is too low", "updated_params": {"*1.2"}}' for name in PARAMETERS]
    bytes_first.train_from_iterator(corpus * 20, trainer)
    tokenizer = transformers.PreTrainedTokenizerFast(
        tokenizer_object=bytes_first, eos_token="<|im_end|>", pad_token="<|endoftext|>"
    )
    tokenizer.chat_template = (
        "{% for message in messages %}<|im_start|>{{ message['role'] }}\n{{ message['content'] }}<|im_end|>\n"
        "{% endfor %}{% if add_generation_prompt %}<|im_start|>assistant\n{% endif %}"
    )
    tokenizer.save_pretrained(folder)
    torch.manual_seed(0)
    config = transformers.Qwen2Config(
        vocab_size=len(tokenizer),
        hidden_size=64,
        intermediate_size=128,
        num_hidden_layers=2,
        num_attention_heads=4,
        num_key_value_heads=2,
        max_position_embeddings=32768,
        bos_token_id=None,
        eos_token_id=tokenizer.eos_token_id,
        pad_token_id=tokenizer.pad_token_id,
    )
    transformers.Qwen2ForCausalLM(config).save_pretrained(folder)
    return folder
