import json
import time

import pytest
from bsa.backends.opening import open_backend
from bsa.backends.options import BackendOptions
from bsa.core.errors import BsaError
from bsa.core.messages import ALTERNATIVES, BackendFailure, Message
from bsa.plugins.agent.actions import Offer, action_schema
from bsa_toy_cell import space

PNG = b"\x89PNG\r\n\x1a\n"


def _open(server, **options):
    return open_backend("openai:served-model", {"base_url": f"{server.url}/v1", **options})


def _ok(chat_completion, proposal):
    return 200, {}, chat_completion(json.dumps(proposal))


def test_a_reply_with_its_accounts(serve, chat_completion, proposal, messages, schema):
    server = serve(lambda seen, handler: _ok(chat_completion, proposal))
    backend = _open(server, temperature=0.4)
    reply = backend.complete(messages, schema, seed=2**32 - 1)
    assert json.loads(reply.text) == proposal
    assert (reply.structured_by, reply.model) == ("schema", "served-model")
    assert (reply.usage.prompt_tokens, reply.usage.completion_tokens, reply.usage.cost_usd) == (11, 7, None)
    assert reply.usage.seconds > 0
    assert any("price" in note for note in reply.notes)
    body = server.seen[-1].body
    assert body["response_format"]["json_schema"]["schema"] == schema
    assert (body["temperature"], body["model"]) == (0.4, "served-model")
    assert 0 <= body["seed"] < 2**31


@pytest.mark.parametrize(
    ("refused", "expected"), [({"json_schema"}, "json"), ({"json_schema", "json_object"}, "text"), (set(), "schema")]
)
def test_a_refused_form_is_stepped_down_from_once(
    serve, chat_completion, proposal, messages, schema, refused, expected
):
    def answer(seen, handler):
        form = (seen.body.get("response_format") or {}).get("type")
        if form in refused:
            return 400, {}, json.dumps({"error": {"message": f"{form} is not supported"}}).encode()
        return _ok(chat_completion, proposal)

    server = serve(answer)
    backend = _open(server)
    first = backend.complete(messages, schema, seed=0)
    assert first.structured_by == expected
    assert sum("refused" in note for note in first.notes) == len(refused)
    calls = len(server.seen)
    second = _open(server).complete(messages, schema, seed=1)
    assert second.structured_by == expected
    assert len(server.seen) == calls + 1
    if refused:
        assert "JSON Schema" in server.seen[-1].body["messages"][-1]["content"]


def test_free_text_fits_into_a_short_reply(serve, chat_completion, proposal, messages, schema):
    server = serve(lambda seen, handler: _ok(chat_completion, proposal))
    _open(server, max_reply_tokens=80).complete(messages, {**schema, ALTERNATIVES: [schema]}, seed=0)
    sent = server.seen[0].body["response_format"]["json_schema"]["schema"]
    for own in (sent, *sent[ALTERNATIVES]):
        assert own["properties"]["analysis"]["maxLength"] == 20
        # A change is no free text.
        changes = own["properties"]["updated_params"]["properties"].values()
        assert {change["maxLength"] for change in changes} == {24}


def _called(chat_completion, name, arguments):
    call = {"id": "1", "type": "function", "function": {"name": name, "arguments": arguments}}
    message = {"role": "assistant", "content": None, "tool_calls": [call]}
    return 200, {}, chat_completion("", choices=[{"index": 0, "finish_reason": "tool_calls", "message": message}])


def test_actions_are_tools_where_that_is_asked_for(serve, chat_completion, messages):
    offer = Offer(("set", "look"), space(), ("cc_discharge",), reasoning=False)
    server = serve(lambda seen, handler: _called(chat_completion, "look", '{"step": "cc_discharge"}'))
    reply = _open(server, tool_calls=True).complete(messages, action_schema(offer), seed=0)
    assert json.loads(reply.text) == {"action": "look", "step": "cc_discharge"}
    assert reply.structured_by == "tools"
    [seen] = server.seen
    functions = {tool["function"]["name"]: tool["function"]["parameters"] for tool in seen.body["tools"]}
    assert functions["set"]["required"] == ["updated_params"]
    assert list(functions["look"]["properties"]) == ["step"]
    assert seen.body["tool_choice"] == "required"
    assert "response_format" not in seen.body
    assert "calling the tool" in seen.body["messages"][-1]["content"]


def test_an_object_without_actions_is_one_tool(serve, chat_completion, proposal, messages, schema):
    server = serve(lambda seen, handler: _called(chat_completion, "answer", json.dumps(proposal)))
    reply = _open(server, tool_calls=True).complete(messages, schema, seed=0)
    assert json.loads(reply.text) == proposal
    assert [tool["function"]["name"] for tool in server.seen[0].body["tools"]] == ["answer"]


@pytest.mark.parametrize("refusing", [True, False])
def test_a_server_without_tools_is_asked_by_schema(serve, chat_completion, proposal, messages, schema, refusing):
    def answer(seen, handler):
        if "tools" in seen.body and refusing:
            return 400, {}, b'{"error": {"message": "tools are not supported"}}'
        return _ok(chat_completion, proposal)

    server = serve(answer)
    backend = _open(server, tool_calls=True)
    replies = [backend.complete(messages, schema, seed=seed) for seed in (0, 1)]
    assert [reply.structured_by for reply in replies] == ["schema", "schema"]
    assert any("tools" in note for note in replies[0].notes)
    # A refusal is remembered; that a model once called nothing is not, and what it said instead was paid for.
    assert len(server.seen) == (3 if refusing else 4)
    answers = 1 if refusing else 2
    for reply in replies:
        assert (reply.usage.prompt_tokens, reply.usage.completion_tokens) == (11 * answers, 7 * answers)


def test_a_hosted_model_gets_tools_in_the_strict_subset(serve, chat_completion, messages, monkeypatch):
    offer = Offer(("set", "predict"), space(), reasoning=False)
    change = json.dumps({"updated_params": dict.fromkeys(space().names) | {space().names[0]: "*1.2"}})
    server = serve(lambda seen, handler: _called(chat_completion, "predict", change))
    monkeypatch.setenv("OPENAI_API_KEY", "sk-openai-secret-000000")
    monkeypatch.setenv("OPENAI_API_BASE", f"{server.url}/v1")
    backend = open_backend("litellm:openai/o3", {"tool_calls": True})
    reply = backend.complete(messages, action_schema(offer), seed=1)
    assert json.loads(reply.text) == {"action": "predict", "updated_params": {space().names[0]: "*1.2"}}
    function = server.seen[-1].body["tools"][0]["function"]
    assert function["strict"] is True
    assert function["parameters"]["properties"]["updated_params"]["required"] == list(space().names)


def test_a_server_that_ignores_the_schema_is_not_believed(serve, chat_completion, messages, schema):
    server = serve(lambda seen, handler: (200, {}, chat_completion("Sure! ```json\n{}\n```")))
    reply = _open(server).complete(messages, schema, seed=0)
    assert reply.structured_by == "text"
    assert any("did not keep to it" in note for note in reply.notes)


def test_rate_limits_are_waited_for_as_asked(serve, chat_completion, proposal, messages, schema):
    def answer(seen, handler):
        if len(server.seen) == 1:
            return 429, {"retry-after": "0.3"}, b'{"error": {"message": "slow down"}}'
        return _ok(chat_completion, proposal)

    server = serve(answer)
    began = time.monotonic()
    reply = _open(server).complete(messages, schema, seed=0)
    assert time.monotonic() - began >= 0.3
    assert any("tried again after 0.3 s" in note for note in reply.notes)


def test_a_wait_beyond_the_limit_is_a_lost_round(serve, messages, schema):
    server = serve(lambda seen, handler: (429, {"retry-after": "3600"}, b"{}"))
    began = time.monotonic()
    with pytest.raises(BackendFailure, match="RateLimitError"):
        _open(server, retry_limit_s=60).complete(messages, schema, seed=0)
    assert time.monotonic() - began < 30
    assert len(server.seen) == 1


def test_a_stalling_server_is_left(serve, messages, schema):
    server = serve(lambda seen, handler: time.sleep(120))
    began = time.monotonic()
    with pytest.raises(BackendFailure, match="no reply"):
        _open(server, timeout_s=0.5, retry_limit_s=0.1).complete(messages, schema, seed=0)
    assert time.monotonic() - began < 60


def test_a_dripping_server_is_left(serve, messages, schema):
    def drip(seen, handler):
        handler.wfile.write(b"HTTP/1.1 200 OK\r\ncontent-type: application/json\r\ncontent-length: 1000\r\n\r\n")
        for _ in range(1000):
            handler.wfile.write(b" ")
            handler.wfile.flush()
            time.sleep(0.2)

    began = time.monotonic()
    with pytest.raises(BackendFailure, match="no answer within"):
        _open(serve(drip), timeout_s=0.5, retry_limit_s=0.1).complete(messages, schema, seed=0)
    assert time.monotonic() - began < 60


@pytest.mark.parametrize(("status", "words"), [(401, "key"), (403, "key"), (404, "know")])
def test_what_no_retry_mends_is_said(serve, messages, schema, status, words, monkeypatch):
    monkeypatch.setenv("BSA_API_KEY", "very-secret-value-123")
    server = serve(lambda seen, handler: (status, {}, json.dumps({"error": dict(seen.headers)}).encode()))
    with pytest.raises(BsaError, match=words) as caught:
        _open(server).complete(messages, schema, seed=0)
    assert len(server.seen) == 1
    assert "very-secret-value-123" not in str(caught.value)


def test_the_hint_names_what_is_likely(serve, messages, schema, monkeypatch):
    def hint(status, path="/v1"):
        server = serve(lambda seen, handler: (status, {}, b'{"error": {"message": "no", "type": "none"}}'))
        options = {"base_url": f"{server.url}{path}"}
        with pytest.raises(BsaError) as raised:
            open_backend("openai:served-model", options).complete(messages, schema, seed=1)
        return raised.value.hint

    monkeypatch.delenv("BSA_API_KEY", raising=False)
    assert "end in /v1?" in hint(404, "")
    assert hint(404).startswith("check the model's name: curl http://")
    assert hint(401) == "export BSA_API_KEY=..."
    monkeypatch.setenv("BSA_API_KEY", "wrong-key-of-mine")
    assert hint(401) == "correct the key in BSA_API_KEY: it was sent, and refused."


def test_a_prompt_too_long_sheds_memories(serve, chat_completion, proposal, messages, schema):
    def answer(seen, handler):
        if "priors" in seen.body["messages"][-1]["content"]:
            message = "This model's maximum context length is 10 tokens."
            return 400, {}, json.dumps({"error": {"message": message, "code": "context_length_exceeded"}}).encode()
        return _ok(chat_completion, proposal)

    reply = _open(serve(answer)).complete(messages, schema, seed=0)
    assert [note.split('"')[1] for note in reply.notes if "left out" in note] == [
        "Memory: rounds so far",
        "Memory: priors",
    ]
    assert reply.structured_by == "schema"


def test_images_go_to_models_that_see(serve, chat_completion, proposal, schema, tmp_path):
    (tmp_path / "a.png").write_bytes(PNG)
    shown = [Message("user", "look", (tmp_path / "a.png", tmp_path / "missing.png"))]
    server = serve(lambda seen, handler: _ok(chat_completion, proposal))
    blind = _open(server).complete(shown, schema, seed=0)
    assert isinstance(server.seen[-1].body["messages"][0]["content"], str)
    assert any("2 images left out" in note for note in blind.notes)
    seeing = _open(server, sees_images=True)
    assert seeing.sees_images
    reply = seeing.complete(shown, schema, seed=0)
    assert server.seen[-1].body["messages"][0]["content"][1]["image_url"]["url"].startswith("data:image/png;base64,")
    assert any("1 image left out: no such file" in note for note in reply.notes)


def test_no_provider_key_goes_to_an_address_of_ones_own(
    serve, chat_completion, proposal, messages, schema, monkeypatch
):
    monkeypatch.setenv("OPENAI_API_KEY", "sk-openai-secret-000000")
    server = serve(lambda seen, handler: _ok(chat_completion, proposal))
    _open(server).complete(messages, schema, seed=0)
    assert "secret" not in json.dumps(server.seen[-1].headers)
    monkeypatch.setenv("BSA_API_KEY", "own-secret-000000")
    _open(server).complete(messages, schema, seed=0)
    assert server.seen[-1].headers["authorization"] == "Bearer own-secret-000000"


def test_a_key_that_comes_back_in_a_reply_is_taken_out(serve, chat_completion, messages, schema, monkeypatch):
    monkeypatch.setenv("BSA_API_KEY", "own-secret-000000")
    server = serve(
        lambda seen, handler: (200, {}, chat_completion(json.dumps(seen.headers), model="own-secret-000000"))
    )
    assert "own-secret" not in repr(_open(server).complete(messages, schema, seed=0))


def test_hosted_models_need_their_key():
    with pytest.raises(BsaError, match="export OPENAI_API_KEY"):
        open_backend("litellm:openai/o3")
    with pytest.raises(BsaError, match="PROVIDER/MODEL"):
        open_backend("litellm:nobody/nothing")


def test_litellm_knows_what_a_hosted_model_can(monkeypatch):
    monkeypatch.setenv("OPENAI_API_KEY", "sk-openai-secret-000000")
    monkeypatch.setenv("GROQ_API_KEY", "gsk-secret-000000")
    assert open_backend("litellm:openai/o3").sees_images
    assert not open_backend("litellm:groq/openai/gpt-oss-120b").sees_images


def test_an_address_holds_no_key():
    with pytest.raises(ValueError, match="no user name, key"):
        BackendOptions(base_url="http://user:pass@127.0.0.1/v1")


def test_a_hosted_model_gets_the_strict_subset_and_is_paid(
    serve, chat_completion, proposal, messages, schema, monkeypatch
):
    left_out = {**proposal["updated_params"], "Separator porosity": None}
    answer = json.dumps({**proposal, "updated_params": left_out})
    usage = {
        "prompt_tokens": 1000,
        "completion_tokens": 500,
        "total_tokens": 1500,
        "completion_tokens_details": {"reasoning_tokens": 400},
    }
    server = serve(lambda seen, handler: (200, {}, chat_completion(answer, model="o3", usage=usage)))
    monkeypatch.setenv("OPENAI_API_KEY", "sk-openai-secret-000000")
    monkeypatch.setenv("OPENAI_API_BASE", f"{server.url}/v1")
    backend = open_backend("litellm:openai/o3", {"temperature": 0.5, "reasoning_effort": "low"})
    reply = backend.complete(messages, {**schema, ALTERNATIVES: [schema]}, seed=1)
    assert json.loads(reply.text) == proposal
    assert reply.structured_by == "schema"
    assert reply.usage.reasoning_tokens == 400
    assert reply.usage.cost_usd > 0
    body = server.seen[-1].body
    assert body["max_completion_tokens"] == 32768
    assert "temperature" not in body
    assert body["reasoning_effort"] == "low"
    sent = body["response_format"]["json_schema"]["schema"]
    assert sent["properties"]["updated_params"]["required"] == list(
        schema["properties"]["updated_params"]["properties"]
    )
    assert "maxLength" not in json.dumps(sent)
    assert ALTERNATIVES not in sent
