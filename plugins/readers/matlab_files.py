"""What a ``.mat`` file holds, as mappings, lists and arrays: versions 4 to 7 by SciPy, 7.3 (HDF5) by h5py."""

import zlib
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ...core.errors import BsaError
from ...core.extras import require
from .matlab_depth import MOST, too_deep
from .source import MAX_BYTES, decoding, refuse_large

_HDF5 = b"\x89HDF\r\n\x1a\n"
_HDF5_OFFSETS = (0, 512)
"""MATLAB writes a header of 512 bytes before the HDF5 file."""

_COMPRESSED = 15
"""The type of an element that is a compressed variable."""


def load(path: Path, source: str) -> dict[str, Any]:
    """Read all variables.

    Structs are mappings, struct arrays and cell arrays of structs lists, columns arrays of shape (n,). Raises
    `BsaError` if the file is damaged or too large, or h5py is needed and absent.
    """
    with decoding(source, "MATLAB file", "save it again in MATLAB, or download it again."):
        with open(path, "rb") as file:
            head = file.read(1024)
        newer = any(head[k:].startswith(_HDF5) for k in _HDF5_OFFSETS)
        return _from_hdf5(path, source) if newer else _from_scipy(path, source)


def _from_scipy(path: Path, source: str) -> dict[str, Any]:
    from scipy.io import loadmat

    _refuse_hostile(path, source)
    variables = loadmat(path, simplify_cells=True)
    return {name: value for name, value in variables.items() if not name.startswith("__")}


def _refuse_hostile(path: Path, source: str) -> None:
    """Unpack the variables within limits, and look how deep they are: what SciPy would not survive is refused."""
    size = path.stat().st_size
    with open(path, "rb") as file:
        head = file.read(128)
        # Version 4 has no such header, no packing and no structs; a file of version 5 says its byte order in it.
        order: Literal["little", "big"] = "little" if head[126:128] == b"IM" else "big"
        while head[126:128] in (b"IM", b"MI") and size <= MAX_BYTES:
            tag = file.read(8)
            if len(tag) < 8:
                break
            kind, length = (int.from_bytes(part, order) for part in (tag[:4], tag[4:]))
            content = file.read(min(length, MAX_BYTES))
            unpacked = zlib.decompressobj()
            variable = unpacked.decompress(content, MAX_BYTES + 1) if kind == _COMPRESSED else tag + content
            size += len(variable)
            if too_deep(variable, order):
                raise BsaError(f"{source} nests structs more than {MOST} deep.", "save the structs with the columns.")
    if size > MAX_BYTES:
        raise BsaError(f"{source} unpacks to more than {MAX_BYTES // 2**20} MiB.", "save fewer variables in it.")


def _from_hdf5(path: Path, source: str) -> dict[str, Any]:
    h5py = require("h5py", "readers", f"{source} (MATLAB 7.3)")
    with h5py.File(path, "r") as file:
        return {name: value for name, value in _fields(file, _Budget(source)).items() if not name.startswith("#")}


class _Budget:
    """How many bytes were read; no more than `MAX_BYTES` may be."""

    def __init__(self, source: str) -> None:
        self.spent, self.source = 0, source

    def spend(self, size: int) -> None:
        self.spent += size + 64  # each item costs something, so that no loop of references is endless
        refuse_large(self.spent, self.source, "save fewer variables in it.")


def _fields(group: Any, budget: _Budget) -> dict[str, Any]:
    """The members of a group; links out of the file are not followed."""
    inside = [name for name in group if type(group.get(name, getlink=True)).__name__ == "HardLink"]
    return {name: _item(group[name], budget) for name in inside if name != "#refs#"}


def _item(item: Any, budget: _Budget) -> Any:
    if hasattr(item, "keys"):
        fields = _fields(item, budget)
        # Each field of a struct array is a list of references that no class is written to, unlike a cell array.
        if fields and all(
            hasattr(item[name], "dtype") and item[name].dtype.kind == "O" and not item[name].attrs for name in fields
        ):
            return [dict(zip(fields, values, strict=True)) for values in zip(*fields.values(), strict=True)]
        return fields
    budget.spend(item.nbytes)
    if item.attrs.get("MATLAB_empty") or item.is_virtual or item.external:
        return np.zeros(0)
    values = np.squeeze(item[()])
    if item.dtype.kind == "O":
        cells = [_item(item.file[reference], budget) for reference in np.atleast_1d(values).ravel()]
        return np.array(cells, dtype=object) if all(isinstance(cell, str) for cell in cells) else cells
    if item.attrs.get("MATLAB_class") == b"char":
        return "".join(map(chr, np.atleast_1d(values).ravel()))
    return values.item() if values.ndim == 0 else values
