"""Deep nesting is found wherever SciPy would follow it, and never in an honest file."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.reading.reading import read_record
from bsa.plugins.readers.matlab_depth import MOST, too_deep
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import savemat


def nested(depth: int) -> dict:
    content: dict = {"x": 1.0}
    for k in range(depth):
        content = {"a" * (1 + k % 7): content, "b": np.arange(3.0)}
    return content


def variable(content: dict) -> bytes:
    file = io.BytesIO()
    savemat(file, {"v": content}, long_field_names=True)
    return file.getvalue()[128:]


@pytest.mark.parametrize(("depth", "deep"), [(1, False), (MOST - 3, False), (MOST + 1, True), (MOST + 50, True)])
def test_the_depth_of_structs(depth, deep):
    assert too_deep(variable(nested(depth)), "little") == deep


LEAF = st.one_of(
    st.floats(allow_nan=False), st.text("abc", max_size=9), st.lists(st.integers(-9, 9), max_size=9).map(np.array)
)
VALUE = st.recursive(LEAF, lambda inner: st.dictionaries(st.text("abc", min_size=1, max_size=7), inner, max_size=4))


@pytest.mark.slow
@given(st.dictionaries(st.text("xyz", min_size=1, max_size=5), VALUE, max_size=4), st.integers(0, 3))
@settings(max_examples=60, deadline=None)
def test_what_stands_beside_it_does_not_hide_a_deep_struct(fields, cells):
    cell = np.array([{"q": 1.0}, "w", np.zeros(0)] * cells + [0], dtype=object)
    fields = {**fields, "c": np.array([1j, 2.0]), "cells": cell}
    assert not too_deep(variable(fields), "little")
    assert too_deep(variable({**fields, "zz": nested(MOST + 1)}), "little")


@given(st.binary(max_size=400))
def test_noise_is_no_depth(noise):
    too_deep(noise, "little")
    too_deep(variable(nested(3))[:200] + noise, "big")


def hostile(path: Path, depth: int) -> None:
    """Structs of one field inside each other, which no MATLAB would write and SciPy follows to its end."""

    def element(kind: int, content: bytes) -> bytes:
        return struct.pack("<II", kind, len(content)) + content + bytes(-len(content) % 8)

    start = element(6, struct.pack("<II", 2, 0)) + element(5, struct.pack("<ii", 1, 1)) + element(1, b"")
    start += struct.pack("<HHi", 5, 4, 8) + element(1, b"a".ljust(8, b"\0"))
    size, parts = 0, []
    for _ in range(depth):
        size += len(start) + 8
        parts.append(struct.pack("<II", 14, size - 8 + 8) + start)
    packed = zlib.compress(b"".join(reversed(parts)) + struct.pack("<II", 14, 0))
    header = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<HH", 0x0100, 0x4D49)
    path.write_bytes(header + struct.pack("<II", 15, len(packed)) + packed)


def test_a_file_that_would_end_the_process_is_refused(tmp_path):
    path = tmp_path / "a.mat"
    hostile(path, 100_000)
    with pytest.raises(BsaError, match=f"nests structs more than {MOST} deep"):
        read_record(path)
