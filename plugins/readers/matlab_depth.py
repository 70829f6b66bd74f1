"""How deeply the structs of a MATLAB 5 variable are nested, found without following them.

SciPy follows them by calling itself in compiled code, so a file of a few kilobytes can end the process: no exception
tells of a stack that overflows. The layout is that of MathWorks' "MAT-File Format".
"""

import struct
from typing import Literal

MOST = 100
"""Records are nested a few structs deep; SciPy can follow some thousands."""

_MATRIX = 14
_CELL, _STRUCT, _OBJECT, _SPARSE, _FUNCTION, _OPAQUE = 1, 2, 3, 5, 16, 17
_COMPLEX = 0x800
_MOST_DIMS = 32
"""SciPy reads no array of more dimensions."""


class _Elements:
    """Reads tags one after the other."""

    def __init__(self, data: bytes, order: Literal["little", "big"]) -> None:
        self.data, self.place = data, 0
        self._words = struct.Struct("<II" if order == "little" else ">II")
        self._order: Literal["little", "big"] = order

    def words(self) -> tuple[int, int]:
        """The next eight bytes as two numbers."""
        one, two = self._words.unpack_from(self.data, self.place)
        self.place += 8
        return one, two

    def skip(self) -> tuple[int, int]:
        """Where the content of the next element, which holds no others, begins and ends."""
        kind, size = self.words()
        if kind >> 16:  # a small element holds its size beside its type, and its content in place of the size
            return self.place - 4, self.place - 4 + (kind >> 16)
        begin = self.place
        self.place += (size + 7) // 8 * 8
        return begin, begin + size

    def numbers(self) -> list[int]:
        """The content of the next element as numbers of four bytes, 32 of them at most."""
        begin, end = self.skip()
        return [
            int.from_bytes(self.data[k : k + 4], self._order) for k in range(begin, min(end, begin + 4 * _MOST_DIMS), 4)
        ]


def too_deep(data: bytes, order: Literal["little", "big"]) -> bool:
    """Whether a variable, unpacked, nests its structs and cells more than `MOST` deep.

    ``data`` is the element of the variable, its tag included; one that is damaged is not, which SciPy then says.
    ``order`` is the byte order of the file.
    """
    elements = _Elements(data, order)
    waiting = [1]  # how many arrays are still to come at each depth
    try:
        while waiting:
            if waiting[-1] == 0:
                waiting.pop()
                continue
            waiting[-1] -= 1
            inside = _array(elements)
            if inside:
                waiting.append(inside)
            if len(waiting) > MOST:
                return True
    except struct.error:
        return False
    return False


def _array(elements: _Elements) -> int:
    """Pass over the next array up to the arrays inside it, and say how many there are."""
    kind, size = elements.words()
    if kind != _MATRIX:
        raise struct.error("no array")
    if size == 0:
        return 0
    elements.words()
    flags, _ = elements.words()
    what = flags & 0xFF
    if what == _OPAQUE:
        for _ in range(3):
            elements.skip()
        return 1
    count = 1
    for length in elements.numbers():
        count *= length
    elements.skip()  # the name
    if what == _OBJECT:
        elements.skip()  # the name of its class
    if what in (_STRUCT, _OBJECT):
        (width,) = elements.numbers() or [1]
        begin, end = elements.skip()
        return count * ((end - begin) // max(width, 1))
    if what == _CELL:
        return count
    if what == _FUNCTION:
        return 1
    for _ in range((3 if what == _SPARSE else 1) + bool(flags & _COMPLEX)):
        elements.skip()
    return 0
