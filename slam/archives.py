# SPDX-License-Identifier: Apache-2.0
"""NumPy archives (.npz) as data: bounded before they are unpacked, one error for all damage."""

import math
import struct
import warnings
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tokenize import TokenError
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from slam.bounded import check_file
from slam.errors import LogFormatError

MAX_BYTES = 1 << 31  # of all arrays unpacked: more than any file of ours
_ENCRYPTED = 1  # bit of a member's flags
_LEVEL = 1  # of zlib
_MAX_EXTRA = 32  # bytes of a member's extra field: that of Zip64; more may hide other members
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)  # what NumPy writes
_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
# What zipfile, zlib and NumPy raise for bytes that are no whole archive.
BROKEN = (
    zipfile.BadZipFile, zlib.error, struct.error, TokenError, SyntaxError, EOFError, OSError,
    ValueError, TypeError, KeyError, IndexError, OverflowError, MemoryError, RecursionError,
    NotImplementedError,
)  # fmt: skip


class Header(NamedTuple):
    """What an array is before it is unpacked."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]


def write_arrays(file: IO[bytes], arrays: Mapping[str, NDArray[Any]]) -> None:
    """As ``np.savez_compressed``, in two thirds of the time and 7 % more bytes."""
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=_LEVEL) as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                npy.write_array(member, np.asanyarray(array), allow_pickle=False)


def read_arrays(
    path: Path, names: Iterable[str] | None = None, *, max_bytes: int = MAX_BYTES
) -> dict[str, NDArray[Any]]:
    """The arrays of a file that ``np.savez`` or ``np.savez_compressed`` wrote, by name.

    names      those to read; all when None
    max_bytes  that they may have unpacked, all together

    Sizes are checked before anything is unpacked: a member's header must claim what its entry in
    the archive claims. Objects (pickles) are refused. Raises ``LogFormatError``, which names the
    file, for one that is missing, torn, damaged, too large or lacks a name.
    """
    with _opened(path) as archive:
        members = _members(path, archive)
        wanted = list(members) if names is None else list(names)
        for name in wanted:
            if name not in members:
                raise LogFormatError(path, f"holds no array {name!r}")
        claimed = sum(members[name].file_size for name in wanted)
        if claimed > max_bytes:
            raise LogFormatError(
                path, f"unpacks to {claimed} bytes; at most {max_bytes} are allowed"
            )
        return {name: _array(path, archive, members[name], max_bytes) for name in wanted}


def read_headers(path: Path) -> dict[str, Header]:
    """Type and shape of all arrays of such a file, by name, of which none is unpacked.

    Raises ``LogFormatError`` as ``read_arrays`` does.
    """
    with _opened(path) as archive:
        return {
            name: _header(path, archive, info, MAX_BYTES)
            for name, info in _members(path, archive).items()
        }


@contextmanager
def _opened(path: Path) -> Iterator[zipfile.ZipFile]:
    """The archive; whatever is wrong with it in here is a ``LogFormatError``."""
    check_file(path)
    try:
        with zipfile.ZipFile(path) as archive, warnings.catch_warnings():
            # A header of Python 2 is no damage in itself.
            warnings.filterwarnings("ignore", "Reading `.npy`", UserWarning)
            yield archive
    except LogFormatError:
        raise
    except BROKEN as error:
        why = f"{type(error).__name__}: {error}"
        raise LogFormatError(path, f"no whole NumPy archive ({why})") from error


def _members(path: Path, archive: zipfile.ZipFile) -> dict[str, zipfile.ZipInfo]:
    members: dict[str, zipfile.ZipInfo] = {}
    for info in archive.infolist():
        name = info.filename.removesuffix(".npy")
        if name == info.filename or name in members:
            raise LogFormatError(path, f"no NumPy archive: member {info.filename[:80]!r}")
        odd = info.comment or len(info.extra) > _MAX_EXTRA or info.flag_bits & _ENCRYPTED
        if odd or info.compress_type not in _METHODS:
            raise LogFormatError(path, f"array {name!r} is packed as NumPy never does")
        members[name] = info
    return members


def _array(
    path: Path, archive: zipfile.ZipFile, info: zipfile.ZipInfo, max_bytes: int
) -> NDArray[Any]:
    _header(path, archive, info, max_bytes)
    with archive.open(info) as member:
        array: NDArray[Any] = npy.read_array(member, allow_pickle=False)
        return array


def _header(path: Path, archive: zipfile.ZipFile, info: zipfile.ZipInfo, max_bytes: int) -> Header:
    """Shape times item size must be the bytes that the archive claims for it."""
    with archive.open(info) as member:
        version = npy.read_magic(member)
        if version not in _HEADERS:
            raise LogFormatError(path, f"{info.filename}: version {version} of .npy is not known")
        shape, _, dtype = _HEADERS[version](member)
        rest = info.file_size - member.tell()
    count = math.prod(shape)
    if dtype.hasobject:
        raise LogFormatError(path, f"{info.filename}: holds objects, not numbers or text")
    if min(shape, default=0) < 0 or count * dtype.itemsize != rest or count > max_bytes:
        raise LogFormatError(
            path, f"{info.filename}: shape {shape} of {dtype} does not fit its {rest} bytes"
        )
    return Header(shape, dtype)
