# SPDX-License-Identifier: Apache-2.0
"""Packed bytes unpacked up to a limit: a small file may claim, and hold, more than any memory."""

import bz2
import io
import lzma
import struct
import sys
import zlib
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO, cast

from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]  # rosbags brings both
from rosbags.rosbag1 import reader as ros1
from rosbags.rosbag2 import storage_mcap

from slam.errors import LogFormatError

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

MAX_CHUNK_BYTES = 1 << 29  # of a bag, unpacked; writers use 1 to 100 MB
MAX_FILE_BYTES = 1 << 35  # of a file of a bag that was packed whole
MAX_TEXT_BYTES = 1 << 29  # of a text log, unpacked; the longest public ones have 200 MB
MAX_RAWLOG_BYTES = 1 << 29  # of a rawlog, unpacked: laser and odometry of hours
MAX_MAT_BYTES = 1 << 28  # of a MATLAB file, unpacked; those of Victoria Park have 5 MB
XZ_MEMORY_BYTES = 1 << 27  # to unpack an .xz; ``xz -9`` needs 65 MB
_STEP = 1 << 20
_ZSTD = b"\x28\xb5\x2f\xfd"


def bounded(decompressor: Any, data: bytes, most: int) -> bytes:
    """The bytes of ``data``; ``ValueError`` where they are more than ``most``, or not complete."""
    out: bytes = decompressor.decompress(data, max_length=most + 1)
    if len(out) > most:
        raise ValueError(f"a chunk unpacks to more than {most} bytes")
    if not decompressor.eof:
        raise ValueError("a chunk ends before its end")
    return out


def beginning(data: bytes, compression: str) -> bytes:
    """What the first bytes of a chunk that was cut unpack to, as far as they go."""
    if compression in ("", "none"):
        return data
    make = {"lz4": LZ4FrameDecompressor, "zstd": zstd.ZstdDecompressor, "bz2": bz2.BZ2Decompressor}
    try:
        return bytes(make[compression]().decompress(data, max_length=MAX_CHUNK_BYTES))
    except (EOFError, OSError, RuntimeError, ValueError, zstd.ZstdError):
        return b""


def unpacked(file: BinaryIO) -> BinaryIO:
    """A bag's file that was packed whole, as it is unpacked; bounded."""
    return cast(BinaryIO, _File(zstd.open(file, "rb")))


def of_message(data: bytes) -> bytes:
    """A message, also of a bag whose messages were packed one by one; bounded.

    What ROS 2 writes never begins as Zstandard does.
    """
    if not data.startswith(_ZSTD):
        return data
    return bounded(zstd.ZstdDecompressor(), data, MAX_CHUNK_BYTES)


def _of_size(make: Any) -> Any:
    """A decompressor of MCAP's: bytes and the size that the file claims."""

    def unpack(data: bytes, size: int) -> bytes:
        if size > MAX_CHUNK_BYTES:
            raise ValueError(f"a chunk claims {size} bytes; at most {MAX_CHUNK_BYTES} are allowed")
        return bounded(make(), data, size)

    return unpack


class _File(io.RawIOBase):
    """A packed bag file as it is unpacked, up to ``MAX_FILE_BYTES``."""

    def __init__(self, packed: Any) -> None:
        self._packed, self._left = packed, MAX_FILE_BYTES

    def readable(self) -> bool:
        """It is."""
        return True

    def read(self, size: int = -1) -> bytes:
        """The next bytes; ``ValueError`` where they are too many."""
        out: bytes = self._packed.read(size if size >= 0 else _STEP)
        self._left -= len(out)
        if self._left < 0:
            raise ValueError(f"a file of the bag unpacks to more than {MAX_FILE_BYTES} bytes")
        return out


def bound_rosbags() -> None:
    """Put bounded decompressors in place of those of the rosbags library, which has no limits."""
    storage_mcap.DECOMPRESSORS["lz4"] = _of_size(LZ4FrameDecompressor)
    storage_mcap.DECOMPRESSORS["zstd"] = _of_size(zstd.ZstdDecompressor)
    ros1.decompressors["bz2"] = lambda data: bounded(bz2.BZ2Decompressor(), data, MAX_CHUNK_BYTES)
    ros1.decompressors["lz4"] = lambda data: bounded(LZ4FrameDecompressor(), data, MAX_CHUNK_BYTES)


def open_xz(path: Path) -> BinaryIO:
    """An .xz file to read lines of; ``lzma.LZMAError`` where it takes ``XZ_MEMORY_BYTES``."""
    with path.open("rb") as file:
        probe = lzma.LZMADecompressor(lzma.FORMAT_XZ, memlimit=XZ_MEMORY_BYTES)
        probe.decompress(file.read(_STEP), max_length=1)
    return cast(BinaryIO, lzma.open(path))


_COMPRESSED, _HEADER_BYTES, _TAG_BYTES = 15, 128, 8  # of a MATLAB 5 file


def check_mat(path: Path) -> None:
    """Raise ``LogFormatError`` for a MATLAB 5 file that unpacks to more than ``MAX_MAT_BYTES``."""
    if path.stat().st_size > MAX_MAT_BYTES:
        raise LogFormatError(path, f"has more than {MAX_MAT_BYTES} bytes")
    data = path.read_bytes()
    order = ">" if data[126:128] == b"MI" else "<"
    at, total = _HEADER_BYTES, 0
    while at + _TAG_BYTES <= len(data):
        kind, size = struct.unpack_from(order + "II", data, at)
        at += _TAG_BYTES
        if kind == _COMPRESSED:
            with suppress(zlib.error):  # the reader says what is wrong
                most = MAX_MAT_BYTES - total + 1
                total += len(zlib.decompressobj().decompress(data[at : at + size], most))
            if total > MAX_MAT_BYTES:
                raise LogFormatError(path, f"unpacks to more than {MAX_MAT_BYTES} bytes")
        at += size
