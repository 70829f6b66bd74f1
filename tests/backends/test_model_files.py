from types import SimpleNamespace

import pytest
from bsa.backends.model_files import bytes_in_sixteen_bits


@pytest.mark.parametrize(
    ("config", "size"),
    [
        (SimpleNamespace(dtype="bfloat16"), 1000),
        (SimpleNamespace(dtype="float32"), 500),
        (SimpleNamespace(dtype=None), 1000),
        (SimpleNamespace(dtype="float32", quantization_config={"quant_method": "mxfp4"}), 1000),
    ],
)
def test_the_size_in_sixteen_bits_follows_from_the_stored_format(tmp_path, config, size):
    (tmp_path / "config.json").write_text("{}")
    (tmp_path / "model.safetensors").write_bytes(bytes(1000))
    assert bytes_in_sixteen_bits(str(tmp_path), config) == size
