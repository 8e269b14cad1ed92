# SPDX-License-Identifier: Apache-2.0
"""What an array of an archive must be: type and shape before it is unpacked, then its values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scripts.comparison.rules import MAX_WORD
from slam.archives import Header
from slam.errors import LogFormatError

MOST_CELLS = 1 << 28  # of a raster, as ``slam.maps`` reads it
MAYBE_NONE = ("movers", "answered")  # lengths that may be 0
_TYPES = {"b": np.bool_, "i": np.int64, "u": np.uint8, "f": np.float64, "U": np.str_}
_KINDS = {"b": "booleans", "i": "whole numbers", "u": "whole numbers", "f": "floats", "U": "words"}


@dataclass(frozen=True, kw_only=True)
class Array:
    """One array.

    kinds   letters of NumPy's types, any of which it may have
    shape   lengths, or their names: what is called alike has the same length
    least, most  of its entries
    finite  without NaN and infinities
    rising  each entry is above the one before
    """

    kinds: str
    shape: tuple[int | str, ...] = ()
    least: float = 0.0
    most: float = math.inf
    finite: bool = True
    rising: bool = False

    def fit(self, header: Header, lengths: dict[str, int]) -> str:
        """What is wrong with its type or shape; "" for nothing. ``lengths`` learns new ones."""
        # One without entries has lost its type: ``np.array([])`` is of floats, whatever it is of.
        if math.prod(header.shape) and header.dtype.kind not in self.kinds:
            kinds = " or ".join(dict.fromkeys(_KINDS[kind] for kind in self.kinds))
            return f"must hold {kinds}, got {header.dtype}"
        if header.dtype.kind == "U" and header.dtype.itemsize > 4 * MAX_WORD:
            return f"must hold words of at most {MAX_WORD} letters, got {header.dtype}"
        if not self._fits(header.shape, lengths):
            wanted = ", ".join(_named(length, lengths) for length in self.shape)
            return f"must have shape ({wanted}), got {header.shape}"
        return ""

    def _fits(self, shape: tuple[int, ...], lengths: dict[str, int]) -> bool:
        """Whether a shape is this; of an array without entries up to its first length of 0."""
        for length, found in zip(self.shape, shape, strict=False):
            if (lengths.get(length, found) if isinstance(length, str) else length) != found:
                return False
            if isinstance(length, str):
                lengths[length] = found
            if found == 0:
                return length in MAYBE_NONE
        return len(shape) == len(self.shape)

    def of_none(self, lengths: Mapping[str, int]) -> NDArray[Any]:
        """The array without entries, in full shape."""
        shape = [lengths.get(length, 0) if isinstance(length, str) else length
                 for length in self.shape]  # fmt: skip
        return np.zeros(shape, dtype=_TYPES[self.kinds[0]])

    def wrong(self, array: NDArray[Any]) -> str:
        """What is wrong with its values; "" for nothing."""
        if array.size == 0 or array.dtype.kind == "b":
            return ""
        if array.dtype.kind == "U":
            bad = next((word for word in array.ravel().tolist() if not word.isprintable()), None)
            return "" if bad is None else f"must hold words that print, got {bad!r:.80}"
        if self.finite and not np.isfinite(array).all():
            return f"must be finite, got {_one(array, ~np.isfinite(array))}"
        out = (array < self.least) | (array > self.most)  # False for NaN
        if out.any():
            return f"must lie in {self.least:g}..{self.most:g}, got {_one(array, out)}"
        if self.rising and (array[1:] <= array[:-1]).any():
            return "must strictly increase"
        return ""


def _one(array: NDArray[Any], bad: NDArray[np.bool_]) -> Any:
    return np.asarray(array)[bad].ravel()[0]


def _named(length: int | str, lengths: Mapping[str, int]) -> str:
    known = lengths.get(length) if isinstance(length, str) else None
    return str(length) if known is None else f"{known} {length}"


def check_shapes(
    path: Path, headers: Mapping[str, Header], wanted: Mapping[str, Array], lengths: dict[str, int]
) -> None:
    """``LogFormatError`` unless these arrays are there, of their types and shapes.

    It asks for nothing that is packed. ``lengths`` are those that are known: it learns the others.
    """
    for name, array in wanted.items():
        if name not in headers:
            raise LogFormatError(path, f"holds no array {name!r}")
        if said := array.fit(headers[name], lengths):
            raise LogFormatError(path, f"array {name!r} {said}")
