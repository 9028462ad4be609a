"""Elements of a MAT file of version 5: whether its tags, classes and dimensions fit each other.

The reader of SciPy believes them, and a wrong one may end Python. Format: MathWorks, MAT-File
Format, version 5. An element is a tag, a type and a number of bytes, and its data, padded to eight
bytes; one of up to four bytes stands in its tag. An array is an element of elements: flags,
dimensions and name, then what its class holds.
"""

from __future__ import annotations

import math
import zlib
from typing import NamedTuple

import numpy as np

HEADER = 128  # [bytes]
INT8, INT32, UINT32, MATRIX, COMPRESSED, UTF8 = 1, 5, 6, 14, 15, 16
NUMBERS = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8}  # types, and their bytes
TEXTS = {INT8, 2, 4, UTF8, 17, 18}
CELL, STRUCT, OBJECT, CHAR, SPARSE, FUNCTION, OPAQUE = 1, 2, 3, 4, 5, 16, 17
NUMERIC = range(6, 16)  # classes
COMPLEX = 0x0800  # of the flags
DEEPEST = 64  # arrays in one another
MOST_DIMENSIONS = 32
BLANK = 1024  # characters of a text without bytes
MOST_INFLATED = 2**30  # [bytes] of a compressed array


class Element(NamedTuple):
    """A type, and its data in a buffer from a byte on."""

    kind: int
    start: int
    size: int


def check_elements(data: bytes) -> None:
    """Refuses a file whose elements do not fit each other, with a ValueError."""
    order = {b"IM": "<", b"MI": ">"}[data[126:128]]
    at = HEADER
    while at < len(data):
        element = _full(data, at, len(data), order)
        end = element.start + element.size
        if element.kind == COMPRESSED:
            inflated = _inflated(data[element.start : end])
            inner = _full(inflated, 0, len(inflated), order)
            _Array(inflated, order).check(inner, 0)
        else:
            _Array(data, order).check(element, 0)
        at = end


def is_version_5(data: bytes) -> bool:
    """Whether a file is one of version 5 to 7.2."""
    return len(data) > HEADER and data[126:128] in (b"IM", b"MI")


def _inflated(data: bytes) -> bytes:
    found = zlib.decompressobj()
    out = found.decompress(data, MOST_INFLATED)
    if found.unconsumed_tail:
        raise ValueError(f"an array of more than {MOST_INFLATED >> 20} MiB")
    return out


def _full(data: bytes, at: int, end: int, order: str) -> Element:
    """An element whose tag takes eight bytes."""
    if at + 8 > end:
        raise ValueError(f"an element at byte {at} is cut off")
    kind, size = np.frombuffer(data, f"{order}u4", 2, at).tolist()
    if size > end - at - 8:
        raise ValueError(f"an element at byte {at} is longer than the rest")
    return Element(kind, at + 8, size)


class _Array:
    """Arrays in a buffer."""

    def __init__(self, data: bytes, order: str):
        self.data, self.order = data, order

    def check(self, array: Element, depth: int) -> None:
        """Refuses an array that does not hold what its class says."""
        if array.kind != MATRIX:
            raise ValueError(f"the element at byte {array.start} is no array")
        if depth > DEEPEST:
            raise ValueError(f"more than {DEEPEST} arrays in one another")
        if array.size == 0 and depth:
            return
        flags, *rest = self._elements(array)
        if flags.kind != UINT32 or flags.size != 8 or flags.start != array.start + 8:
            raise self._wrong(array, "no flags")
        word = self._integers(flags)[0]
        known = word & 0xFF
        if known not in (CELL, STRUCT, OBJECT, CHAR, SPARSE, *NUMERIC, FUNCTION, OPAQUE):
            raise self._wrong(array, f"an unknown class {known}")
        if known != OPAQUE:
            count = self._size(array, rest[:2])
            self._check_parts(array, known, count, bool(word & COMPLEX), rest[2:])
        for each in rest:
            if each.kind == MATRIX:
                self.check(each, depth + 1)

    def _elements(self, array: Element) -> list[Element]:
        """The elements of an array."""
        out, at, end = [], array.start, array.start + array.size
        while at < end:
            element, at = self._next(at, end)
            if element.kind not in NUMBERS and element.kind not in (*TEXTS, MATRIX):
                raise ValueError(f"an element of unknown type {element.kind} at byte {at}")
            out.append(element)
        if not out:
            raise self._wrong(array, "no elements")
        return out

    def _next(self, at: int, end: int) -> tuple[Element, int]:
        """The element at a byte, and where the next one begins."""
        if at + 8 > end:
            raise ValueError(f"an element at byte {at} is cut off")
        word = int(np.frombuffer(self.data, f"{self.order}u4", 1, at)[0])
        if small := word >> 16:
            if small > 4:
                raise ValueError(f"an element at byte {at} is longer than its tag")
            return Element(word & 0xFFFF, at + 4, small), at + 8
        element = _full(self.data, at, end, self.order)
        whole = element.size if element.kind == MATRIX else -(-element.size // 8) * 8
        return element, element.start + whole

    def _integers(self, element: Element) -> list[int]:
        kind = f"{self.order}{'u' if element.kind == UINT32 else 'i'}4"
        return np.frombuffer(self.data, kind, element.size // 4, element.start).tolist()

    def _size(self, array: Element, some: list[Element]) -> int:
        """Product of the dimensions, which a name follows."""
        if len(some) < 2 or some[0].kind not in (INT32, UINT32) or some[1].kind not in TEXTS:
            raise self._wrong(array, "no dimensions and name")
        shape = self._integers(some[0])
        if not 2 <= len(shape) <= MOST_DIMENSIONS or min(shape) < 0:
            raise self._wrong(array, f"dimensions {shape[:4]}")
        return math.prod(shape)

    def _check_parts(
        self, array: Element, known: int, count: int, is_complex: bool, parts: list[Element]
    ) -> None:
        """Refuses parts that are not those of the class."""
        arrays = [x for x in parts if x.kind == MATRIX]
        if known == CELL:
            good = len(parts) == len(arrays) == count
        elif known in (STRUCT, OBJECT):
            good = self._is_struct(parts[known == OBJECT :], count)
        elif known == FUNCTION:
            good = len(arrays) == 1
        elif known == CHAR:
            room = parts[0].size or BLANK if len(parts) == 1 and parts[0].kind in TEXTS else -1
            good = count <= room
        elif known == SPARSE:
            good = self._is_sparse(parts, 3 + is_complex)
        else:
            good = len(parts) == 1 + is_complex and all(self._holds(x, count) for x in parts)
        if not good:
            raise self._wrong(array, f"other parts than its class {known} has")

    def _holds(self, part: Element, count: int) -> bool:
        """Whether numbers are as many as the dimensions say."""
        return part.kind in NUMBERS and part.size == count * NUMBERS[part.kind]

    def _is_struct(self, parts: list[Element], count: int) -> bool:
        if len(parts) < 2 or parts[0].kind != INT32 or parts[0].size != 4:
            return False
        (length,), names, fields = self._integers(parts[0]), parts[1], parts[2:]
        if length < 1 or names.kind not in TEXTS or names.size % length:
            return False
        whole = all(x.kind == MATRIX for x in fields)
        return whole and len(fields) == count * (names.size // length)

    def _is_sparse(self, parts: list[Element], most: int) -> bool:
        """Whether indices of rows and columns stay within the array: SciPy does not ask."""
        if len(parts) != most or any(x.kind not in NUMBERS for x in parts):
            return False
        rows, starts = (self._integers(x) for x in parts[:2])
        steps = all(a <= b for a, b in zip(starts, starts[1:], strict=False))
        within = bool(starts) and starts[0] == 0 and starts[-1] <= len(rows)
        return steps and within and min(rows, default=0) >= 0

    def _wrong(self, array: Element, what: str) -> ValueError:
        return ValueError(f"the array at byte {array.start} has {what}")
