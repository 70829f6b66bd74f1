import shutil
from types import SimpleNamespace

import pytest
from bsa.backends import loaded_model
from bsa.backends.gpu_memory import GpuMemory
from bsa.backends.loaded_model import LoadedModel, load, release, taken_mb
from bsa.core.errors import BsaError

pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.fixture(autouse=True)
def _own_models(monkeypatch):
    """What other tests have loaded is left alone."""
    monkeypatch.setattr(loaded_model, "_loaded", {})


@pytest.fixture
def copy_of_it(tiny_model, tmp_path):
    return shutil.copytree(tiny_model, tmp_path / "copy")


@pytest.mark.slow
def test_a_model_that_nobody_uses_makes_room_for_another(tiny_model, copy_of_it):
    first = load(str(tiny_model), "auto")
    assert load(str(tiny_model), "auto") is first
    release(first)
    load(str(copy_of_it), "auto")
    assert first.model is not None  # It is still open once.
    release(first)
    assert load(str(tiny_model), "auto") is first  # It stays for the next run.
    release(first)
    load(str(copy_of_it), "none")
    assert first.model is None
    assert load(str(tiny_model), "auto") is not first


def test_all_models_share_one_lock(tiny_model, copy_of_it):
    assert load(str(tiny_model), "auto").lock is load(str(copy_of_it), "auto").lock


def test_a_folder_is_found_from_the_home_folder(tiny_model, monkeypatch):
    monkeypatch.setenv("HOME", str(tiny_model.parent))
    monkeypatch.setenv("USERPROFILE", str(tiny_model.parent))
    assert load(f"~/{tiny_model.name}", "auto").context_tokens == 32768


def test_memory_that_the_first_reply_took_is_the_models(tiny_model, monkeypatch):
    resident = iter([100.0, 350.0])
    monkeypatch.setattr(loaded_model, "resident_mb", lambda: next(resident))
    model = load(str(tiny_model), "auto")
    assert taken_mb() == 0.0
    for _ in range(2):
        model.answered()
        assert taken_mb() == 250.0


@pytest.fixture
def gpu(tiny_model, monkeypatch):
    """A GPU by what torch and accelerate say of it; ``placed`` is the model that they would give."""
    import transformers

    asked = SimpleNamespace(placed=None, arguments=None)

    def from_pretrained(name, **arguments):
        asked.arguments = arguments
        return asked.placed

    monkeypatch.setattr(transformers.AutoModelForCausalLM, "from_pretrained", from_pretrained)
    monkeypatch.setattr(loaded_model, "accelerator", lambda: "cuda")
    monkeypatch.setattr("torch.cuda.is_bf16_supported", lambda: True)
    monkeypatch.setattr(GpuMemory, "now", classmethod(lambda cls: cls(free=1e9, total=2e9)))
    monkeypatch.setenv("CUBLAS_WORKSPACE_CONFIG", "set before")
    return asked


def test_what_does_not_fit_the_gpu_is_refused_before_it_is_loaded(tiny_model, gpu, monkeypatch):
    monkeypatch.setattr(GpuMemory, "now", classmethod(lambda cls: cls(free=1e3, total=2e9)))
    with pytest.raises(BsaError, match=r"do not fit into the memory of the GPU: 0\.0 of 2\.0 GB are free.*4-bit"):
        load(str(tiny_model), "auto")
    assert gpu.arguments is None


@pytest.mark.parametrize("place", ["cpu", "disk"])
def test_a_model_of_which_a_part_is_left_in_main_memory_is_refused(tiny_model, gpu, place):
    gpu.placed = SimpleNamespace(hf_device_map={"model.layers.0": 0, "model.layers.1": place})
    with pytest.raises(BsaError, match=r"do not fit .*: 1\.0 of 2\.0 GB are free"):
        load(str(tiny_model), "auto")


def test_a_gpu_that_is_full_without_accelerate_is_told_alike(tiny_model, gpu, monkeypatch):
    import torch

    def full(device):
        raise torch.cuda.OutOfMemoryError("CUDA out of memory. Tried to allocate 136.00 MiB.")

    found = loaded_model.find_spec
    monkeypatch.setattr(loaded_model, "find_spec", lambda name: None if name == "accelerate" else found(name))
    gpu.placed = SimpleNamespace(to=full)
    with pytest.raises(BsaError, match=r"do not fit .*: 1\.0 of 2\.0 GB are free"):
        load(str(tiny_model), "auto")


def test_sixteen_bits_on_a_gpu_that_rounds_alike_each_time(tiny_model, gpu, monkeypatch):
    import os

    import torch

    monkeypatch.delenv("CUBLAS_WORKSPACE_CONFIG")
    gpu.placed = SimpleNamespace(
        hf_device_map={"": 0}, eval=lambda: None, device=torch.device("cuda"), dtype=torch.bfloat16
    )
    assert load(str(tiny_model), "auto").description == "cuda, bfloat16"
    assert gpu.arguments["dtype"] is torch.bfloat16
    assert os.environ["CUBLAS_WORKSPACE_CONFIG"] == ":4096:8"


@pytest.mark.slow
def test_the_context_is_that_of_the_part_that_reads_text():
    transformers = pytest.importorskip("transformers")
    seeing = SimpleNamespace(config=transformers.Gemma3Config(text_config={"max_position_embeddings": 9000}))
    assert LoadedModel(None, seeing, "").context_tokens == 9000


def test_a_folder_that_is_not_there_is_not_looked_for_on_the_hub(tmp_path):
    with pytest.raises(BsaError) as caught:
        load(str(tmp_path / "nothing"), "auto")
    assert caught.value.hint == "check the folder."
