import json
import re
import shutil

import pytest
from bsa.backends.loaded_model import LoadedModel, load
from bsa.backends.opening import open_backend
from bsa.core.messages import BackendFailure, Message, PromptRefused
from bsa.core.proposal import CHANGE_PATTERN
from bsa.plugins.agent.actions import Offer, action_schema, check_action
from bsa_toy_cell import space

pytestmark = pytest.mark.filterwarnings("ignore")


def _valid(text, schema):
    content = json.loads(text)
    assert list(content) == list(schema["properties"])
    for name, rule in schema["properties"].items():
        if name != "updated_params":
            assert len(content[name]) <= rule["maxLength"]
    assert content["updated_params"].keys() <= schema["properties"]["updated_params"]["properties"].keys()
    assert content["updated_params"]
    assert all(re.fullmatch(CHANGE_PATTERN, change) for change in content["updated_params"].values())
    return True


def _open(folder, **options):
    return open_backend(f"transformers:{folder}", options)


@pytest.mark.slow
def test_one_hundred_of_one_hundred_replies_are_valid(tiny_model, messages, schema):
    replies = []
    for temperature in (0.0, 0.3, 0.7, 1.0, 1.8):
        backend = _open(tiny_model, temperature=temperature, max_reply_tokens=600)
        for seed in range(20):
            replies.append(backend.complete(messages, schema, seed=seed))
    assert sum(_valid(reply.text, schema) for reply in replies) == 100
    assert {reply.structured_by for reply in replies} == {"schema"}
    seconds = sum(reply.usage.seconds for reply in replies)
    tokens = sum(reply.usage.completion_tokens for reply in replies)
    print(f"{seconds / 100:.2f} s a reply, {tokens / seconds:.0f} tokens a second")


@pytest.mark.slow
def test_a_reply_is_finished_even_where_tokens_are_few(tiny_model, messages, schema):
    long = json.loads(json.dumps(schema))
    for name in ("analysis", "hypothesis", "rationale"):
        long["properties"][name]["maxLength"] = 5000
    backend = _open(tiny_model, temperature=1.5, max_reply_tokens=400)
    for seed in range(5):
        reply = backend.complete(messages, long, seed=seed)
        assert reply.usage.completion_tokens <= 400
        assert _valid(reply.text, long)


@pytest.mark.slow
def test_an_action_has_what_it_needs_however_weak_the_model(tiny_model, messages):
    offer = Offer(("set", "simulate", "jacobian", "look"), space(), ("cc_discharge",), reasoning=False)
    backend = _open(tiny_model, temperature=1.5, max_reply_tokens=400)
    replies = [backend.complete(messages, action_schema(offer), seed=seed) for seed in range(8)]
    asked = {check_action(json.loads(reply.text), offer, space().initial, []).kind for reply in replies}
    assert len(asked) > 1


@pytest.mark.slow
def test_the_same_seed_gives_the_same_reply(tiny_model, messages, schema):
    backend = _open(tiny_model, temperature=1.0, max_reply_tokens=400)
    first, again, other = (backend.complete(messages, schema, seed=seed).text for seed in (1, 1, 2))
    assert first == again != other


@pytest.mark.slow
def test_the_model_is_loaded_once_and_named(tiny_model, messages, schema):
    first, second = _open(tiny_model), _open(tiny_model, temperature=0.5)
    assert first._inner._loaded is second._inner._loaded is load(str(tiny_model), "auto")
    reply = first.complete(messages, schema, seed=0)
    assert "cpu" in reply.notes[0] or "cuda" in reply.notes[0]
    assert reply.usage.prompt_tokens > 10
    assert not first.sees_images


@pytest.fixture
def small_context(monkeypatch):
    monkeypatch.setattr(LoadedModel, "context_tokens", 2048)


@pytest.mark.usefixtures("small_context")
def test_memories_make_room_from_the_top(tiny_model, schema):
    memories = "".join(f"## Memory: part {number}\n{'x,' * 500}\n\n" for number in range(3))
    prompt = [Message("user", f"## Task\nmatch\n\n{memories}## What to do\nPropose.")]
    reply = _open(tiny_model, max_reply_tokens=400).complete(prompt, schema, seed=0)
    dropped = [note for note in reply.notes if "left out" in note]
    assert dropped
    assert "part 0" in dropped[0]
    assert not any("part 2" in note for note in dropped)
    assert _valid(reply.text, schema)


@pytest.mark.usefixtures("small_context")
def test_a_prompt_without_memories_that_does_not_fit_is_a_lost_round(tiny_model, schema):
    with pytest.raises(BackendFailure, match="context of 2048"):
        _open(tiny_model).complete([Message("user", "x," * 5000)], schema, seed=0)


def test_a_model_without_chat_template_completes_a_transcript(tiny_model, messages, schema, monkeypatch):
    backend = _open(tiny_model, max_reply_tokens=400)
    monkeypatch.setattr(backend._inner._loaded.tokenizer, "chat_template", None)
    assert _valid(backend.complete(messages, schema, seed=0).text, schema)


def test_a_time_limit_ends_a_reply(tiny_model, messages, schema):
    # No machine makes a token in so short a time, and the limit is looked at after each.
    reply = _open(tiny_model, timeout_s=1e-6, max_reply_tokens=1500).complete(messages, schema, seed=0)
    assert reply.usage.completion_tokens == 1
    assert reply.notes[-1] == "the reply was cut at its longest time (1e-06 s; timeout_s)"


@pytest.mark.slow
def test_only_a_reply_that_was_cut_is_told_as_such(tiny_model, messages, schema):
    cut = _open(tiny_model, max_reply_tokens=16).complete(messages, schema, seed=0)
    assert cut.notes[-1] == "the reply was cut at its longest length (16 tokens; max_reply_tokens)"
    whole = _open(tiny_model, max_reply_tokens=400, timeout_s=60).complete(messages, schema, seed=0)
    assert not any("cut" in note for note in whole.notes)
    assert _valid(whole.text, schema)


def test_a_prompt_for_which_the_gpu_has_no_memory_is_refused(tiny_model, messages, schema, monkeypatch):
    import torch

    def full(*_, **__):
        raise torch.cuda.OutOfMemoryError("CUDA out of memory. Tried to allocate 256.00 MiB.")

    backend = _open(tiny_model, max_reply_tokens=400)
    with monkeypatch.context() as patched:
        patched.setattr(backend._inner._loaded.model, "generate", full)
        with pytest.raises(PromptRefused, match=r"has \d+ tokens, .* no memory left for them: end other programs"):
            backend.complete(messages, schema, seed=0)
    assert _valid(backend.complete(messages, schema, seed=0).text, schema)


def test_a_backend_gives_its_model_back_once(tiny_model):
    stays, goes = _open(tiny_model), _open(tiny_model)
    users = stays._inner._loaded.users
    goes.close()
    goes.close()
    assert stays._inner._loaded.users == users - 1


@pytest.fixture
def padded_model(tiny_model, tmp_path):
    """As Qwen's: more rows of weights than the tokenizer has tokens."""
    import transformers

    folder = shutil.copytree(tiny_model, tmp_path / "padded")
    model = transformers.Qwen2ForCausalLM.from_pretrained(tiny_model)
    model.resize_token_embeddings(2 * model.config.vocab_size, mean_resizing=False)
    model.save_pretrained(folder)
    return folder


@pytest.mark.slow
def test_tokens_that_the_tokenizer_lacks_are_never_chosen_under_a_schema(padded_model, messages, schema):
    backend = _open(padded_model, temperature=1.8, max_reply_tokens=400)
    for seed in range(3):
        reply = backend.complete(messages, schema, seed=seed)
        assert reply.structured_by == "schema"
        assert _valid(reply.text, schema)


def test_tokens_that_the_tokenizer_lacks_are_left_out_without_a_schema(padded_model, messages, schema):
    backend = _open(padded_model, temperature=1.8, max_reply_tokens=64)
    backend._inner._loaded.__dict__["grammar_tokenizer"] = None
    reply = backend.complete(messages, schema, seed=0)
    assert reply.structured_by == "text"
    assert reply.text
