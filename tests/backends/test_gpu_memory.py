import pytest
from bsa.backends.gpu_memory import GpuMemory, refuse_larger, too_large
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
