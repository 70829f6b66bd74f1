"""The tiny model behind real OpenAI-compatible servers: llama.cpp's, which enforces schemas, and transformers' own."""

import json
import os
import socket
import subprocess
import sys
import time

import pytest
from bsa.backends.opening import open_backend
from bsa.backends.options import BackendOptions
from bsa.backends.presets import Preset
from bsa.backends.readiness import check_preset
from bsa.core.contracts.reply_parsing import parse_object
from bsa.core.errors import BsaError
from bsa.plugins.agent.actions import Offer, action_schema
from bsa_toy_cell import space

pytestmark = pytest.mark.slow

_LLAMA_SERVER = """
import sys, time, xllamacpp
parameters = xllamacpp.CommonParams()
parameters.model.path = sys.argv[1]
parameters.n_ctx, parameters.n_parallel, parameters.port = 32768, 1, 0
parameters.cpuparams.n_threads = 1
parameters.model_alias = {"tiny"}
server = xllamacpp.Server(parameters)
print(server.listening_address, flush=True)
sys.stdin.read()
"""


@pytest.fixture(scope="module")
def tiny_gguf(tiny_model, tmp_path_factory):
    """The tiny model in llama.cpp's format."""
    gguf = pytest.importorskip("gguf", reason='pip install "battery-sim-agent[servers]"')
    pytest.importorskip("xllamacpp", reason='pip install "battery-sim-agent[servers]"')
    import transformers

    tokenizer = transformers.AutoTokenizer.from_pretrained(tiny_model)
    model = transformers.AutoModelForCausalLM.from_pretrained(tiny_model)
    config = model.config
    path = tmp_path_factory.mktemp("gguf") / "tiny.gguf"
    writer = gguf.GGUFWriter(path, "qwen2")
    writer.add_context_length(config.max_position_embeddings)
    writer.add_embedding_length(config.hidden_size)
    writer.add_block_count(config.num_hidden_layers)
    writer.add_feed_forward_length(config.intermediate_size)
    writer.add_head_count(config.num_attention_heads)
    writer.add_head_count_kv(config.num_key_value_heads)
    writer.add_layer_norm_rms_eps(config.rms_norm_eps)
    content = json.loads(tokenizer.backend_tokenizer.to_str())
    special = {token["content"] for token in content["added_tokens"]}
    vocabulary = sorted(tokenizer.get_vocab(), key=tokenizer.get_vocab().get)
    kinds = [gguf.TokenType.CONTROL if token in special else gguf.TokenType.NORMAL for token in vocabulary]
    writer.add_tokenizer_model("gpt2")
    writer.add_tokenizer_pre("qwen2")
    writer.add_token_list(vocabulary)
    writer.add_token_types(kinds)
    writer.add_token_merges([" ".join(pair) for pair in content["model"]["merges"]])
    writer.add_eos_token_id(tokenizer.eos_token_id)
    writer.add_pad_token_id(tokenizer.pad_token_id)
    writer.add_add_bos_token(False)
    writer.add_chat_template(tokenizer.chat_template)
    names = gguf.get_tensor_name_map(gguf.MODEL_ARCH.QWEN2, config.num_hidden_layers)
    for name, tensor in model.state_dict().items():
        writer.add_tensor(names.get_name(name, (".weight", ".bias")), tensor.float().numpy())
    writer.write_header_to_file()
    writer.write_kv_data_to_file()
    writer.write_tensors_to_file()
    writer.close()
    return path


@pytest.fixture(scope="module")
def llama_server(tiny_gguf):
    process = subprocess.Popen(
        [sys.executable, "-c", _LLAMA_SERVER, str(tiny_gguf)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    address = next((line.strip() for line in process.stdout if line.startswith("http")), None)
    assert address, "the server did not start"
    yield f"{address}/v1"
    process.stdin.close()
    process.stdout.close()
    process.wait(20)


@pytest.fixture(scope="module")
def transformers_server(tiny_model):
    pytest.importorskip("uvicorn", reason='pip install "battery-sim-agent[servers]"')
    pytest.importorskip("fastapi", reason='pip install "battery-sim-agent[servers]"')
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = ["serve", str(tiny_model), "--host", "127.0.0.1", "--port", str(port), "--device", "cpu"]
    process = subprocess.Popen(
        [sys.executable, "-m", "transformers.cli.transformers", *command],
        env={**os.environ, "HF_HUB_OFFLINE": "1"},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    for _ in range(300):
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                break
        assert process.poll() is None, "the server did not start"
        time.sleep(0.2)
    yield f"http://127.0.0.1:{port}/v1"
    process.terminate()
    process.wait(20)


def test_llama_cpp_holds_a_random_model_to_the_schema(llama_server, messages, schema):
    for rule in schema["properties"].values():
        if rule["type"] == "string":
            # This server fails over bytes that are not UTF-8, which a random model makes and a real one does not.
            rule["pattern"] = "^[a-z ]{0,40}$"
    backend = open_backend("openai:tiny", {"base_url": llama_server, "max_reply_tokens": 1500, "temperature": 0.7})
    replies = [backend.complete(messages, schema, seed=seed) for seed in range(20)]
    assert {reply.structured_by for reply in replies} == {"schema"}
    for reply in replies:
        content = json.loads(reply.text)
        assert content.keys() == set(schema["required"])
        assert content["updated_params"].keys() <= schema["properties"]["updated_params"]["properties"].keys()
        assert reply.usage.completion_tokens > 10
    assert backend.complete(messages, schema, seed=3).model


def test_llama_cpp_gives_an_action_what_it_needs(llama_server, messages):
    offer = Offer(("set", "simulate", "jacobian", "look"), space(), ("cc_discharge",), reasoning=False)
    backend = open_backend("openai:tiny", {"base_url": llama_server, "max_reply_tokens": 1500, "temperature": 0.7})
    replies = [backend.complete(messages, action_schema(offer), seed=seed) for seed in range(20)]
    needed = {"set": "updated_params", "simulate": "candidates", "jacobian": "action", "look": "step"}
    contents = [json.loads(reply.text) for reply in replies]
    assert all(needed[content["action"]] in content for content in contents)
    assert len({content["action"] for content in contents}) > 1


def test_a_preset_finds_the_server(llama_server):
    preset = Preset("tiny", {"openai": ("tiny",), "litellm": ("openai/o3",)})
    found = check_preset(preset, BackendOptions(base_url=llama_server))
    assert found[0].ready
    assert not found[1].ready


def test_transformers_serve_ignores_the_schema_and_the_reply_says_so(transformers_server, tiny_model, messages, schema):
    options = {"base_url": transformers_server, "max_reply_tokens": 40}
    reply = open_backend(f"openai:{tiny_model}", options).complete(messages, schema, seed=1)
    assert reply.text
    assert reply.structured_by == "text"
    assert any("did not keep to it" in note for note in reply.notes)
    with pytest.raises(BsaError):
        parse_object(reply.text)


def test_a_whole_run_behind_a_server_finishes(llama_server, run_toy, tmp_path):
    options = {"base_url": llama_server, "max_reply_tokens": 1500, "retry_limit_s": 5}
    backend = open_backend("openai:tiny", options)
    result = run_toy(tmp_path / "run", backend=backend, rounds=2, warm_up=3)
    assert result.llm_calls > 0
    assert result.status == "rounds-spent"
