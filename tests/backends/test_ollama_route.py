import json

import pytest
from bsa.backends.opening import open_backend
from bsa.core.errors import BsaError
from bsa.core.messages import BackendFailure, Message


class Ollama:
    """What Ollama's API documents of /api/chat, /api/tags and /api/show, on canned words."""

    def __init__(self, text, schemas=True, context=8192, capabilities=("completion",)):
        self.text, self.schemas, self.context, self.capabilities = text, schemas, context, list(capabilities)

    def __call__(self, seen, handler):
        status, content = self._answer(seen)
        return status, {}, json.dumps(content).encode()

    def _answer(self, seen):
        if seen.path == "/api/tags":
            return 200, {"models": [{"name": "qwen2.5:14b", "model": "qwen2.5:14b"}]}
        if seen.body["model"] != "qwen2.5:14b":
            return 404, {"error": f"model '{seen.body['model']}' not found"}
        if seen.path == "/api/show":
            details = {"format": "gguf", "family": "qwen2", "parameter_size": "14.8B", "quantization_level": "Q4_K_M"}
            information = {"general.architecture": "qwen2", "qwen2.context_length": self.context}
            return 200, {"details": details, "model_info": information, "capabilities": self.capabilities}
        if isinstance(seen.body.get("format"), dict) and not self.schemas:
            # What servers before 0.5 said, which knew "json" only.
            return 400, {
                "error": "json: cannot unmarshal object into Go struct field ChatRequest.format of type string"
            }
        return 200, {
            "model": "qwen2.5:14b",
            "created_at": "2026-01-01T00:00:00Z",
            "message": {"role": "assistant", "content": self.text},
            "done": True,
            "done_reason": "stop",
            "prompt_eval_count": 26,
            "eval_count": 9,
        }


def _open(server, model="qwen2.5:14b", **options):
    return open_backend(f"ollama:{model}", {"base_url": server.url, **options})


def _chats(server):
    return [seen.body for seen in server.seen if seen.path == "/api/chat"]


def test_the_schema_is_passed_on(serve, proposal, messages, schema):
    server = serve(Ollama(json.dumps(proposal)))
    reply = _open(server, temperature=0.2, max_reply_tokens=500).complete(messages, schema, seed=7)
    assert json.loads(reply.text) == proposal
    assert (reply.structured_by, reply.model) == ("schema", "qwen2.5:14b")
    assert (reply.usage.prompt_tokens, reply.usage.completion_tokens) == (26, 9)
    (body,) = _chats(server)
    assert body["format"] == schema
    assert body["stream"] is False
    assert body["options"] == {"seed": 7, "num_predict": 500, "num_ctx": 4096, "temperature": 0.2}


def test_an_old_server_gets_json_mode_and_is_remembered(serve, proposal, messages, schema):
    server = serve(Ollama(json.dumps(proposal), schemas=False))
    reply = _open(server).complete(messages, schema, seed=0)
    assert reply.structured_by == "json"
    assert "refused a JSON schema" in reply.notes[0]
    _open(server).complete(messages, schema, seed=1)
    assert [type(body["format"]).__name__ for body in _chats(server)] == ["dict", "str", "str"]


def test_the_context_holds_prompt_and_reply(serve, proposal, messages, schema):
    server = serve(Ollama(json.dumps(proposal), context=32768))
    backend = _open(server)
    backend.complete([Message("user", "x" * 30_000)], schema, seed=0)
    assert _chats(server)[-1]["options"]["num_ctx"] == 16384
    with pytest.raises(BackendFailure, match="longer than the model's context"):
        backend.complete([Message("user", "x" * 200_000)], schema, seed=0)
    long = Message("user", f"## Task\n\n## Memory: rounds\n{'x' * 200_000}\n\n## What to do\nPropose.")
    reply = backend.complete([long], schema, seed=0)
    assert any('"Memory: rounds" was left out' in note for note in reply.notes)
    assert "What to do" in _chats(server)[-1]["messages"][0]["content"]


def test_a_prompt_and_its_reply_share_a_short_context(serve, proposal, messages, schema):
    server = serve(Ollama(json.dumps(proposal), context=4096))
    _open(server).complete(messages, schema, seed=0)
    _open(server, max_reply_tokens=3000).complete(messages, schema, seed=0)
    told = [body["options"] for body in _chats(server)]
    assert [(one["num_predict"], one["num_ctx"]) for one in told] == [(2048, 4096), (3000, 4096)]


def test_images_where_the_model_sees(serve, proposal, schema, tmp_path):
    (tmp_path / "a.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    shown = [Message("user", "look", (tmp_path / "a.png",))]
    server = serve(Ollama(json.dumps(proposal), capabilities=("completion", "vision")))
    backend = _open(server)
    assert backend.sees_images
    backend.complete(shown, schema, seed=0)
    assert _chats(server)[-1]["messages"][0]["images"] == ["iVBORw0KGgo="]


def test_what_is_missing_is_said(serve, proposal):
    server = serve(Ollama(json.dumps(proposal)))
    with pytest.raises(BsaError, match=r"ollama pull qwen2\.5:32b"):
        _open(server, "qwen2.5:32b")
    with pytest.raises(BsaError, match="ollama serve"):
        open_backend("ollama:qwen2.5:14b", {"base_url": "http://127.0.0.1:9"})


def test_the_preset_takes_this_route_when_it_is_the_ready_one(serve, proposal, messages, schema, monkeypatch, tmp_path):
    server = serve(Ollama(json.dumps(proposal)))
    monkeypatch.setenv("OLLAMA_HOST", server.url)
    monkeypatch.setenv("HF_HOME", str(tmp_path))
    backend = open_backend("qwen2.5-14b")
    assert backend.name == "qwen2.5-14b via ollama"
    assert json.loads(backend.complete(messages, schema, seed=0).text) == proposal
    with pytest.raises(BsaError, match=r"ollama pull qwen2\.5:32b"):
        open_backend("qwen2.5-32b", {"via": "ollama"})
