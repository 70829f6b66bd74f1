import pytest
from bsa.backends.gpu_memory import GpuMemory, gpu_in_words, refuse_larger, too_large
from bsa.core.errors import BsaError

MEMORY = GpuMemory(free=24.5e9, total=85e9)


def test_weights_that_are_larger_than_the_free_memory_are_refused_with_both_sizes():
    refuse_larger("m", 24e9, False, MEMORY)
    with pytest.raises(BsaError, match=r'weights of "m" \(29\.5 GB\) do not fit .*: 24\.5 of 85\.0 GB are free.*4-bit'):
        refuse_larger("m", 29.5e9, False, MEMORY)


def test_four_bits_take_a_quarter():
    refuse_larger("m", 97e9, True, MEMORY)
    with pytest.raises(BsaError, match="do not fit"):
        refuse_larger("m", 99e9, True, MEMORY)


def test_sizes_that_are_not_known_are_not_told():
    assert too_large("m", 0, None).message == 'the weights of "m" do not fit into the memory of the GPU.'


@pytest.fixture
def cuda(monkeypatch):
    """CUDA as torch shows it, with some GPUs of 85 GB; gives its functions, to be replaced."""
    torch = pytest.importorskip("torch", reason='pip install "battery-sim-agent[local]"')

    def give(names):
        for name, found in {
            "is_available": lambda: bool(names),
            "device_count": lambda: len(names),
            "get_device_name": lambda index: names[index],
            "mem_get_info": lambda index: (24.5e9, 85e9),
        }.items():
            monkeypatch.setattr(torch.cuda, name, found)
        monkeypatch.setattr(torch.backends.mps, "is_available", lambda: False)
        return torch.cuda

    return give


@pytest.mark.parametrize(
    ("names", "words"),
    [
        ([], "no GPU: local models run on the CPU"),
        (["A100"], "GPU: A100 (CUDA), 24.5 of 85.0 GB are free"),
        (["A100", "A100", "T4"], "GPU: 2 x A100, T4 (CUDA), 73.5 of 255.0 GB are free"),
    ],
)
def test_the_gpus_are_named_with_their_free_memory(names, words, cuda):
    cuda(names)
    assert gpu_in_words() == words


def test_a_gpu_that_gives_no_memory_is_told(cuda, monkeypatch):
    def refused(index):
        raise RuntimeError("CUDA error: out of memory\nCompile with ...")

    monkeypatch.setattr(cuda(["A100"]), "mem_get_info", refused)
    assert gpu_in_words() == "GPU: A100 (CUDA), but it cannot be used: CUDA error: out of memory"
