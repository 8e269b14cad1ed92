# SPDX-License-Identifier: Apache-2.0
"""What a file that cannot be read as a log is, by its first bytes, and what helps."""

import io
import lzma
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

MCAP, SQLITE, ROS1 = b"\x89MCAP0\r\n", b"SQLite format 3\0", b"#ROSBAG V"
BAGS = {MCAP: "MCAP (.mcap)", SQLITE: "SQLite (.db3)", ROS1: "a bag of ROS 1 (.bag)"}
PACKED = {  # first bytes -> by what, the command that unpacks it
    b"PK\x03\x04": ("zip", "unzip"),
    b"\x1f\x8b": ("gzip", "gunzip"),
    b"\xfd7zXZ\x00": ("xz", "unxz"),
    b"BZh": ("bzip2", "bunzip2"),
    b"\x28\xb5\x2f\xfd": ("Zstandard", "unzstd"),
    b"\x04\x22\x4d\x18": ("lz4", "unlz4"),
    b"7z\xbc\xaf\x27\x1c": ("7-Zip", "7z x"),
    b"Rar!": ("RAR", "unrar x"),
}
_FOOTER_BYTES, _CHANNEL = 28, 4  # of an MCAP: what its footer and magic end with; a record
_HEAD_BYTES, _TAR_AT, _TAR = 4096, 257, b"ustar"
_LOGS_TOO = ("gzip", "xz")  # text logs are read as they are packed


def what_instead(path: Path) -> str:
    """In words, with the cure; "" where its first bytes do not say.

    A text log or rawlog that is packed by gzip or xz is read as it is, and not named here.
    """
    head = _head(path)
    if head[_TAR_AT:].startswith(_TAR):
        return f"is an archive (tar): unpack it (tar xf {path.name}) and name what is in it"
    for magic, (packer, command) in PACKED.items():
        if head.startswith(magic):
            inside = _unpacked(head, packer)
            if packer in _LOGS_TOO and not (_is_bag(inside) or inside[_TAR_AT:].startswith(_TAR)):
                return ""
            return f"is packed ({packer}): unpack it ({command} {path.name}) and name what is in it"
    if head.startswith(MCAP) and path.suffix == ".mcap":
        return _mcap(path)
    found = next((name for magic, name in BAGS.items() if head.startswith(magic)), "")
    suffix = found.rpartition("(")[2].rstrip(")")
    return f"is {found} by its first bytes: name it so" if found and path.suffix != suffix else ""


def _head(path: Path) -> bytes:
    try:
        if path.is_file():  # a pipe might never end
            with path.open("rb") as file:
                return file.read(_HEAD_BYTES)
    except (OSError, ValueError):  # the last: a null byte in the name
        pass
    return b""


def _is_bag(head: bytes) -> bool:
    return head.startswith(tuple(BAGS))


def _unpacked(head: bytes, packer: str) -> bytes:
    """The first bytes of what is packed, as far as those of the file go."""
    try:
        if packer == "gzip":
            return zlib.decompressobj(31).decompress(head, _HEAD_BYTES)
        if packer == "xz":
            return lzma.LZMADecompressor(memlimit=1 << 27).decompress(head, _HEAD_BYTES)
    except (EOFError, OSError, zlib.error, lzma.LZMAError):
        pass
    return b""


def _mcap(path: Path) -> str:
    """Of an MCAP whose messages are not those of ROS 2."""
    size = path.stat().st_size
    with path.open("rb") as file:
        file.seek(len(MCAP) + 9)
        profile = _text(file)
        file.seek(max(0, size - _FOOTER_BYTES))
        start = int.from_bytes(file.read(8), "little")
        file.seek(start if 0 < start < size else size)
        found = sorted({_encoding(data) for data in _channels(file, size)} - {"cdr"})
    if not found and profile == "ros2":
        return ""
    what = f"messages in {', '.join(found)}" if found else "no profile that says what they are"
    what = what if found or not profile else f"profile {profile}"
    return f"is an MCAP with {what}; messages of ROS 2 (cdr, profile ros2) are read, and a .bag"


def _channels(file: BinaryIO, end: int) -> Iterator[bytes]:
    """The records of channels in a summary."""
    while len(head := file.read(9)) == 9:
        kind, size = struct.unpack("<BQ", head)
        if size > end - file.tell():
            return
        data = file.read(size)
        if kind == _CHANNEL:
            yield data


def _encoding(channel: bytes) -> str:
    rest = io.BytesIO(channel[4:])
    _text(rest)
    return _text(rest)


def _text(file: BinaryIO) -> str:
    size = int.from_bytes(file.read(4), "little")
    return file.read(min(size, _HEAD_BYTES)).decode("utf-8", "replace")
