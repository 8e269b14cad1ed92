# SPDX-License-Identifier: Apache-2.0
"""Named arrays and a few words as one block of bytes, and back. No pickle: loading runs no code."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slam.errors import InvalidValueError

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
    try:
        header = json.loads(block[start:at])
        arrays: dict[str, NDArray[Any]] = {}
        for name in sorted(header["arrays"]):
            dtype, shape = header["arrays"][name]
            count = int(np.prod(shape, dtype=np.int64))
            arrays[name] = np.frombuffer(block, np.dtype(dtype), count, at).reshape(shape).copy()
            at += arrays[name].nbytes
        words: dict[str, Any] = header["words"]
    except (ValueError, KeyError, TypeError) as error:
        raise InvalidValueError(f"this saved world is damaged: {error}") from error
    if at != len(block):
        raise InvalidValueError(f"this saved world is damaged: {len(block) - at} bytes too many")
    return arrays, words


def random_words(rng: np.random.Generator) -> dict[str, Any]:
    """The state of a generator as JSON words."""
    return dict(rng.bit_generator.state)


def restore_random(rng: np.random.Generator, words: Mapping[str, Any]) -> None:
    """Inverse of ``random_words``; ``InvalidValueError`` for another kind of generator."""
    try:
        rng.bit_generator.state = dict(words)
    except (ValueError, TypeError, KeyError) as error:
        raise InvalidValueError(f"this state of a generator does not fit: {error}") from error
