"""Memory of this process, read through the operating system, so that a wrong address is an error and no crash."""

from __future__ import annotations

import ctypes
import os
import sys

from trpac_core.vision.images import ImageError


def read_memory(address: int, size: int) -> bytearray:
    """A copy of `size` bytes at an address.

    Raises
    ------
    ImageError
        If not all of them can be read, or the system has no such call.
    """
    data = bytearray(size)
    copied, reason = _copy(address, size, (ctypes.c_char * size).from_buffer(data))
    if copied != size:
        raise ImageError(
            f"the {size} bytes at address {address:#x} cannot be read ({reason or f'only {copied} are there'}); "
            "expected the address of a picture that stays until the step has ended."
        )
    return data


if sys.platform == "win32":  # pragma: no cover - not run on the machines of this project

    def _copy(address: int, size: int, buffer: ctypes.Array[ctypes.c_char]) -> tuple[int, str]:
        """Number of bytes copied, and why not all are."""
        kernel = ctypes.WinDLL("kernel32", use_last_error=True)
        kernel.GetCurrentProcess.restype = ctypes.c_void_p
        read = kernel.ReadProcessMemory
        read.argtypes = (*(ctypes.c_void_p,) * 3, ctypes.c_size_t, ctypes.POINTER(ctypes.c_size_t))
        copied = ctypes.c_size_t(0)
        if read(kernel.GetCurrentProcess(), address, buffer, size, ctypes.byref(copied)):
            return copied.value, ""
        return 0, ctypes.FormatError(ctypes.get_last_error())

elif sys.platform == "linux":

    class _Span(ctypes.Structure):
        """The C library's `struct iovec`."""

        _fields_ = (("address", ctypes.c_void_p), ("size", ctypes.c_size_t))

    def _copy(address: int, size: int, buffer: ctypes.Array[ctypes.c_char]) -> tuple[int, str]:
        """Number of bytes copied, and why not all are."""
        read = ctypes.CDLL(None, use_errno=True).process_vm_readv
        read.argtypes = (ctypes.c_int, *(ctypes.POINTER(_Span), ctypes.c_ulong) * 2, ctypes.c_ulong)
        read.restype = ctypes.c_ssize_t
        here, there = _Span(ctypes.addressof(buffer), size), _Span(address, size)
        copied = read(os.getpid(), ctypes.byref(here), 1, ctypes.byref(there), 1, 0)
        return (copied, "") if copied >= 0 else (0, os.strerror(ctypes.get_errno()))

else:

    def _copy(address: int, size: int, buffer: ctypes.Array[ctypes.c_char]) -> tuple[int, str]:
        """Number of bytes copied, 0, and the reason: a wrong address could not be caught here."""
        return 0, f"pictures in memory cannot be read safely on {sys.platform}: give them by image_path"
