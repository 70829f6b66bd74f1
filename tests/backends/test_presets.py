import subprocess
import sys
import time
from importlib.util import find_spec

import pytest
from bsa.backends.catalogue import bsa_backends
from bsa.backends.looking import forget_looks
from bsa.backends.opening import open_backend
from bsa.backends.options import BackendOptions
from bsa.backends.presets import load_presets
from bsa.backends.readiness import check_preset, survey
from bsa.core.contracts.registry import Registry
from bsa.core.errors import BsaError

STUDY = ("qwen2.5-7b", "qwen2.5-14b", "qwen2.5-32b", "o3", "gpt-oss-20b", "gpt-oss-120b")


def _registry():
    import bsa.backends.catalogue as catalogue

    registry = Registry()
    registry.register(catalogue, "builtin-backends", "battery-sim-agent 0")
    return registry.collect()


def test_the_models_of_the_paper_are_there():
    assert set(STUDY) <= load_presets().keys()
    assert set(STUDY) | {"rules", "manual", "replay"} <= {entry.name for entry in bsa_backends()}


@pytest.mark.slow
def test_listing_imports_no_client():
    code = (
        "import sys, bsa.backends.catalogue as c; list(c.bsa_backends());"
        "print([n for n in ('litellm', 'torch', 'ollama', 'transformers', 'httpx') if n in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


def test_a_user_adds_a_preset_in_four_lines(tmp_path, monkeypatch):
    path = tmp_path / "mine.yaml"
    path.write_text(
        "my-model:\n  ollama: my-model:8b\n  transformers: me/my-model\n  litellm: openrouter/me/my-model\n"
    )
    monkeypatch.setenv("BSA_PRESETS", str(path))
    assert load_presets()["my-model"].models["ollama"] == ("my-model:8b",)
    assert "my-model" in {entry.name for entry in bsa_backends()}
    monkeypatch.delenv("BSA_PRESETS")
    path.rename(tmp_path / "bsa-presets.yaml")
    monkeypatch.chdir(tmp_path)
    assert "my-model" in load_presets()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("m: x", "names no route"),
        ("m:\n  ollama: 3", "names 3"),
        ("m: [", "not valid YAML"),
        ("- m", "holds no presets"),
    ],
)
def test_a_bad_preset_file_is_explained(tmp_path, monkeypatch, content, words):
    path = tmp_path / "mine.yaml"
    path.write_text(content)
    monkeypatch.setenv("BSA_PRESETS", str(path))
    with pytest.raises(BsaError, match=words):
        load_presets()


def test_a_mistyped_route_is_told_with_its_file_when_the_preset_is_used(tmp_path, monkeypatch):
    path = tmp_path / "mine.yaml"
    path.write_text("m:\n  olama: x\nother:\n  litellm: openai/o3")
    monkeypatch.setenv("BSA_PRESETS", str(path))
    with pytest.raises(BsaError, match=r'mine\.yaml: preset "m": there is no route "olama".*did you mean "ollama"'):
        open_backend("m", registry=_registry())
    monkeypatch.setenv("OPENAI_API_KEY", "some-value")
    assert open_backend("other", registry=_registry()).name == "other via litellm"
    (row,) = [item for item in survey() if item.backend == "m"]
    assert not row.ready
    assert 'did you mean "ollama"' in row.remedy


def test_a_machine_without_the_model_says_what_is_missing(monkeypatch, tmp_path):
    monkeypatch.setenv("HF_HOME", str(tmp_path))
    monkeypatch.setenv("OLLAMA_HOST", "127.0.0.1:9")
    monkeypatch.setattr("bsa.backends.ollama_route.which", lambda name: None)
    with pytest.raises(BsaError) as caught:
        open_backend("qwen2.5-14b", registry=_registry())
    for remedy in (
        "https://ollama.com/download",
        "hf download Qwen/Qwen2.5-14B-Instruct" if find_spec("transformers") else "battery-sim-agent[local]",
        "export TOGETHERAI_API_KEY=",
        "vllm serve",
    ):
        assert remedy in caught.value.hint
    with pytest.raises(BsaError, match="its routes are litellm"):
        open_backend("o3", {"via": "ollama"}, _registry())
    with pytest.raises(BsaError, match=r'did you mean "qwen2\.5-14b"'):
        open_backend("qwen2.5-14", registry=_registry())
    with pytest.raises(BsaError, match="litellm:MODEL"):
        open_backend("litellm", registry=_registry())


def test_a_key_makes_the_hosted_route_ready(monkeypatch, tmp_path):
    monkeypatch.setenv("HF_HOME", str(tmp_path))
    monkeypatch.setenv("OLLAMA_HOST", "127.0.0.1:9")
    monkeypatch.setenv("DEEPINFRA_API_KEY", "secret-value")
    found = {item.route: item for item in check_preset(load_presets()["qwen2.5-7b"], BackendOptions())}
    assert found["litellm"].ready
    assert found["litellm"].model.startswith("deepinfra/")
    assert open_backend("qwen2.5-7b", registry=_registry()).name == "qwen2.5-7b via litellm"
    assert "secret-value" not in repr(found)


def test_downloaded_weights_make_the_in_process_route_ready(monkeypatch, tmp_path):
    pytest.importorskip("transformers", reason='pip install "battery-sim-agent[local]"')
    snapshot = tmp_path / "hub" / "models--Qwen--Qwen2.5-14B-Instruct" / "snapshots" / "abc"
    snapshot.mkdir(parents=True)
    (snapshot / "config.json").write_text("{}")
    (snapshot / "model.safetensors").write_bytes(b"")
    monkeypatch.setenv("HF_HOME", str(tmp_path))
    found = {item.route: item for item in check_preset(load_presets()["qwen2.5-14b"], BackendOptions())}
    assert found["transformers"].ready


def test_a_server_of_ones_own_is_asked_what_it_serves(serve, monkeypatch):
    content = b'{"object": "list", "data": [{"id": "Qwen/Qwen2.5-14B-Instruct"}]}'
    server = serve(lambda seen, handler: (200, {}, content))
    options = {"base_url": f"{server.url}/v1"}
    assert open_backend("qwen2.5-14b", options, _registry()).name == "qwen2.5-14b via openai"
    with pytest.raises(BsaError, match=r"serves Qwen/Qwen2\.5-14B-Instruct"):
        open_backend("qwen2.5-7b", options, _registry())


@pytest.mark.slow
def test_the_survey_is_quick_where_servers_are_silent(serve, monkeypatch):
    server = serve(lambda seen, handler: time.sleep(60))
    monkeypatch.setenv("OLLAMA_HOST", server.url)
    monkeypatch.setenv("OPENAI_BASE_URL", f"{server.url}/v1")
    forget_looks()
    began = time.monotonic()
    found = survey()
    assert time.monotonic() - began < 30
    assert all(item.ready or item.remedy for item in found)
    assert {item.backend for item in found} >= set(STUDY)


def test_options_that_a_backend_does_not_have_are_refused():
    with pytest.raises(BsaError, match="temperature"):
        open_backend("rules", {"temperature": 1.0}, _registry())
    assert open_backend("rules", {}, _registry()).name == "rules"
    assert open_backend("rules", {"votes": 3}, _registry()).name == "rules, 3 votes"
