"""A key goes only where it belongs, by whichever route."""

import json

import pytest
from bsa.backends.api_keys import ollama_server_key, openai_server_key
from bsa.backends.opening import open_backend
from bsa.backends.options import BackendOptions
from bsa.backends.readiness import check
from bsa.core.errors import BsaError
from bsa.core.messages import BackendUnreachable

SECRETS = {
    "OPENAI_API_KEY": "sk-openai-secret",
    "OPENAI_ORG_ID": "org-secret",
    "OPENAI_ORGANIZATION": "organisation-secret",
    "OPENAI_PROJECT": "project-secret",
    "OPENAI_PROJECT_ID": "project-id-secret",
    "OPENAI_CUSTOM_HEADERS": "X-Custom: custom-secret",
    "OLLAMA_API_KEY": "ollama-secret",
    "ANTHROPIC_API_KEY": "anthropic-secret",
    "HF_TOKEN": "hf-secret",
}
OWN_HEADERS = {"host", "accept", "content-type", "content-length", "user-agent", "connection", "accept-encoding"}


@pytest.fixture
def secrets(monkeypatch):
    for name, value in SECRETS.items():
        monkeypatch.setenv(name, value)


@pytest.fixture
def server(serve, chat_completion, proposal):
    """Answers as an OpenAI-compatible server and as Ollama."""

    def answer(seen, handler):
        if seen.path == "/api/tags":
            return 200, {}, b'{"models": [{"model": "m"}]}'
        if seen.path == "/api/show":
            return 200, {}, b'{"model_info": {}, "capabilities": ["completion"]}'
        if seen.path == "/api/chat":
            content = {"model": "m", "message": {"role": "assistant", "content": json.dumps(proposal)}, "done": True}
            return 200, {}, json.dumps(content).encode()
        return 200, {}, chat_completion(json.dumps(proposal))

    return serve(answer)


def _headers(server):
    assert server.seen
    return [seen.headers for seen in server.seen]


@pytest.mark.slow
@pytest.mark.parametrize(("spec", "path"), [("openai:m", "/v1"), ("ollama:m", "")])
def test_a_server_of_ones_own_gets_nothing_from_the_environment(server, secrets, messages, schema, spec, path):
    options = {"base_url": f"{server.url}{path}"}
    open_backend(spec, options).complete(messages, schema, seed=0)
    check("m", spec.partition(":")[0], "m", BackendOptions(**options, via=spec.partition(":")[0]))
    for headers in _headers(server):
        assert set(headers) <= OWN_HEADERS
        assert "secret" not in repr(headers)


@pytest.mark.slow
@pytest.mark.parametrize(("spec", "path"), [("openai:m", "/v1"), ("ollama:m", "")])
def test_its_own_key_goes_to_the_server_that_is_named(server, secrets, messages, schema, spec, path, monkeypatch):
    monkeypatch.setenv("BSA_API_KEY", "own-key")
    options = {"base_url": f"{server.url}{path}"}
    open_backend(spec, options).complete(messages, schema, seed=0)
    check("m", spec.partition(":")[0], "m", BackendOptions(**options, via=spec.partition(":")[0]))
    for headers in _headers(server):
        assert headers["authorization"] == "Bearer own-key"
        assert set(headers) <= OWN_HEADERS | {"authorization"}


def test_a_key_named_together_with_an_address_goes_there(server, secrets, messages, schema, monkeypatch):
    monkeypatch.setenv("OPENAI_BASE_URL", f"{server.url}/v1")
    monkeypatch.setenv("OLLAMA_HOST", server.url)
    open_backend("openai:m").complete(messages, schema, seed=0)
    open_backend("ollama:m").complete(messages, schema, seed=0)
    check("m", "ollama", "m", BackendOptions())
    check("m", "openai", "m", BackendOptions())
    sent = [(seen.path.partition("/")[2][:3], seen.headers["authorization"]) for seen in server.seen]
    assert set(sent) == {("v1/", "Bearer sk-openai-secret"), ("api", "Bearer ollama-secret")}
    assert not any("organisation" in repr(headers) or "project" in repr(headers) for headers in _headers(server))


def test_a_login_in_an_address_goes_to_that_address(server, secrets, messages, schema, monkeypatch):
    monkeypatch.setenv("OPENAI_BASE_URL", f"{server.url.replace('://', '://me:pw@')}/v1")
    open_backend("openai:m").complete(messages, schema, seed=0)
    check("m", "openai", "m", BackendOptions())
    assert {headers["authorization"] for headers in _headers(server)} == {"Basic bWU6cHc="}


@pytest.mark.parametrize(
    ("address", "host", "by_option", "variable"),
    [
        ("https://ollama.com", None, True, "OLLAMA_API_KEY"),
        ("https://ollama.com:443", None, True, "OLLAMA_API_KEY"),
        ("http://ollama.com", None, True, "BSA_API_KEY"),
        ("https://ollama.com.example", None, True, "BSA_API_KEY"),
        ("https://ollama.com@evil.example", None, True, "BSA_API_KEY"),
        ("https://ollama.com:8443", None, True, "BSA_API_KEY"),
        ("http://192.0.2.1:11434", None, True, "BSA_API_KEY"),
        ("http://192.0.2.1:11434", "192.0.2.1", False, None),
        ("http://192.0.2.1:11434", "192.0.2.1", True, "BSA_API_KEY"),
        ("https://gpu.example", "https://gpu.example", False, "OLLAMA_API_KEY"),
        ("https://gpu.example", "https://gpu.example", True, "OLLAMA_API_KEY"),
        ("http://127.0.0.1:11434", None, False, None),
        ("http://127.0.0.1:11434", "0.0.0.0", False, "OLLAMA_API_KEY"),
        ("http://localhost:5000", "localhost:5000", False, "OLLAMA_API_KEY"),
    ],
)
def test_where_the_key_of_ollama_belongs(address, host, by_option, variable, monkeypatch):
    if host is not None:
        monkeypatch.setenv("OLLAMA_HOST", host)
    assert ollama_server_key(address, by_option) == variable


@pytest.mark.parametrize(
    ("address", "by_option", "variable"),
    [
        ("https://gpu.example/v1", False, "OPENAI_API_KEY"),
        ("http://127.0.0.1:8000/v1", False, "OPENAI_API_KEY"),
        ("http://gpu.example/v1", False, "BSA_API_KEY"),
        ("https://gpu.example/v1", True, "BSA_API_KEY"),
    ],
)
def test_where_the_key_of_openai_belongs(address, by_option, variable):
    assert openai_server_key(address, by_option) == variable


@pytest.mark.parametrize(
    ("model", "variable"),
    [("openai/o3", "OPENAI_API_BASE"), ("anthropic/claude-sonnet-4-5", "ANTHROPIC_API_BASE")],
)
def test_a_providers_key_does_not_travel_unencrypted(secrets, messages, schema, model, variable, monkeypatch):
    monkeypatch.setenv(variable, "http://host.invalid/v1")
    with pytest.raises(BackendUnreachable, match=r"key is not sent to host\.invalid unencrypted"):
        open_backend(f"litellm:{model}").complete(messages, schema, seed=0)


def test_a_provider_without_a_key_may_be_asked_unencrypted(serve, proposal, messages, schema, monkeypatch):
    """As a model server in the same room, which litellm knows by its kind."""
    answer = {"model": "m", "message": {"role": "assistant", "content": json.dumps(proposal)}, "done": True}
    proxy = serve(lambda seen, handler: (200, {}, json.dumps(answer).encode()))
    monkeypatch.setenv("http_proxy", proxy.url)
    monkeypatch.setenv("OLLAMA_API_BASE", "http://host.invalid")
    reply = open_backend("litellm:ollama_chat/m").complete(messages, schema, seed=0)
    assert json.loads(reply.text) == proposal
    assert "http://host.invalid/api/chat" in {seen.path for seen in proxy.seen}


@pytest.mark.parametrize(("spec", "path"), [("openai:m", "/v1"), ("ollama:m", "")])
def test_no_redirect_is_followed(serve, secrets, messages, schema, monkeypatch, spec, path):
    monkeypatch.setenv("BSA_API_KEY", "own-key")
    elsewhere = serve(lambda seen, handler: (200, {}, b"{}"))
    server = serve(lambda seen, handler: (307, {"location": f"{elsewhere.url}/x"}, b""))
    with pytest.raises((BackendUnreachable, BsaError), match=f"redirects to {elsewhere.url}/x, which is not followed"):
        open_backend(spec, {"base_url": f"{server.url}{path}"}).complete(messages, schema, seed=0)
    assert (len(server.seen), elsewhere.seen) == (1, [])
