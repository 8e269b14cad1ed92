# SPDX-License-Identifier: Apache-2.0
"""Named arrays and a few words as one block of bytes, and back. No pickle: loading runs no code."""

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slam.errors import InvalidValueError

Records = NDArray[Any]
"""(n,) rows of a table whose columns have names (``record``)."""
Record = Any
"""One of them."""

MOST_AXES = 8  # of an array; ours have up to three
_MAGIC = b"mobilia-world-1\n"


def pack(arrays: Mapping[str, NDArray[Any]], words: Mapping[str, Any]) -> bytes:
    """``words`` must be JSON; arrays keep type, shape and every bit."""
    entries = {name: [a.dtype.str, list(a.shape)] for name, a in arrays.items()}
    header = json.dumps({"words": dict(words), "arrays": entries}, sort_keys=True).encode()
    body = b"".join(np.ascontiguousarray(arrays[name]).tobytes() for name in sorted(arrays))
    return _MAGIC + len(header).to_bytes(8, "little") + header + body


def unpack(block: bytes) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Inverse of ``pack``; ``InvalidValueError`` for anything else than its output."""
    start = len(_MAGIC) + 8
    if not isinstance(block, bytes) or block[: len(_MAGIC)] != _MAGIC or len(block) < start:
        raise InvalidValueError("this is no saved world: it does not start with its mark")
    at = start + int.from_bytes(block[len(_MAGIC) : start], "little")
    if at > len(block):
        raise InvalidValueError(
            f"this saved world is damaged: a header of {at - start} bytes in {len(block)}"
        )
    try:
        header = json.loads(block[start:at])
        arrays: dict[str, NDArray[Any]] = {}
        for name in sorted(header["arrays"]):
            claimed, edges = header["arrays"][name]
            dtype, shape = _claimed(name, claimed, edges, len(block) - at)
            array = np.frombuffer(block, dtype, math.prod(shape), at)
            arrays[name] = array.reshape(shape).copy()
            at += array.nbytes
        words: dict[str, Any] = dict(header["words"])
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        raise InvalidValueError(f"this saved world is damaged: {error}") from error
    if at != len(block):
        raise InvalidValueError(f"this saved world is damaged: {len(block) - at} bytes too many")
    return arrays, words


def _claimed(name: str, dtype: Any, shape: Any, left: int) -> tuple[np.dtype[Any], tuple[int, ...]]:
    """Type and shape of an array, which must be plain numbers and fit the ``left`` bytes."""
    kind = np.dtype(dtype) if isinstance(dtype, str) else None
    if kind is None or kind.kind not in "biuf" or kind.shape:
        raise ValueError(f"array {name!r} is of type {dtype!r:.40}, which is no number's")
    whole = isinstance(shape, list) and all(type(edge) is int and edge >= 0 for edge in shape)
    if not whole or len(shape) > MOST_AXES or math.prod(shape) * kind.itemsize > left:
        raise ValueError(f"array {name!r} of shape {shape!r:.60} does not fit {left} bytes")
    return kind, tuple(shape)


def random_words(rng: np.random.Generator) -> dict[str, Any]:
    """The state of a generator as JSON words."""
    return dict(rng.bit_generator.state)


def restore_random(rng: np.random.Generator, words: Mapping[str, Any]) -> None:
    """Inverse of ``random_words``; ``InvalidValueError`` for another kind of generator."""
    try:
        rng.bit_generator.state = dict(words)
    except (ValueError, TypeError, KeyError) as error:
        raise InvalidValueError(f"this state of a generator does not fit: {error}") from error


def record(number: type, names: str) -> np.dtype[Any]:
    """A row whose columns have names: ``table[i].name`` in kernels, else ``table["name"][i]``."""
    return np.dtype([(name, number) for name in names.split()])


def flat(records: Records) -> NDArray[Any]:
    """The same numbers (n, columns), live, as they are saved."""
    numbers: NDArray[Any] = records.view(records.dtype[0])
    return numbers.reshape(len(records), len(records.dtype.names or ()))
