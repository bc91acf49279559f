"""Addresses of pictures as a unit's inputs, and one where readable memory ends."""

from __future__ import annotations

import ctypes
import mmap


def pointing_to(address: int, size: int) -> dict[str, int]:
    return {
        "image.base.lo": ctypes.c_int32(address & 0xFFFFFFFF).value,
        "image.base.hi": ctypes.c_int32(address >> 32).value,
        "image.size": size,
    }


KEPT: list[mmap.mmap] = []


def edge() -> int:
    """The address where readable memory ends."""
    two = mmap.mmap(-1, 2 * mmap.PAGESIZE)
    start = ctypes.addressof(ctypes.c_char.from_buffer(two))
    KEPT.append(two)
    library = ctypes.CDLL(None, use_errno=True)
    library.mprotect.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int)
    assert library.mprotect(start + mmap.PAGESIZE, mmap.PAGESIZE, 0) == 0
    return start + mmap.PAGESIZE
