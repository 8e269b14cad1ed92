# SPDX-License-Identifier: Apache-2.0
"""What a number must be before it enters a type: shape, finite, a possible covariance."""

import math
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slam.errors import InvalidValueError, NotFiniteError

Float = NDArray[np.float64]
MOST_NS = 2**63 - 1  # of a stamp, either way; Unix times reach it in the year 2262


def is_number(value: object, kinds: tuple[type, ...] = (int, float)) -> TypeGuard[float]:
    """Whether a value is a number of one of these types; True and False are none."""
    return isinstance(value, kinds) and not isinstance(value, bool)


def is_whole(value: object) -> TypeGuard[int]:
    """Whether a value is a whole number, of Python or NumPy; True and False are none."""
    return is_number(value, (int, np.integer))


def frozen(
    owner: str, name: str, value: ArrayLike, shape: tuple[int | None, ...], dtype: Any = np.float64
) -> NDArray[Any]:
    """A read-only copy of ``value`` with the given shape (None: any length) and type.

    Raises ``InvalidValueError`` that names owner and field when it cannot be one.
    """
    try:
        array = np.array(value, dtype=dtype) if dtype is np.float64 else _cast(value, dtype)
    except (TypeError, ValueError, ArithmeticError) as error:
        raise InvalidValueError(f"{owner}.{name} must be numeric: {error}") from error
    if array.shape != shape and (
        array.ndim != len(shape)
        or any(
            want is not None and have != want for have, want in zip(array.shape, shape, strict=True)
        )
    ):
        wanted = "(" + ", ".join("n" if n is None else str(n) for n in shape) + ")"
        raise InvalidValueError(f"{owner}.{name} must have shape {wanted}, got {array.shape}")
    array.setflags(write=False)
    return array


def _cast(value: ArrayLike, dtype: Any) -> NDArray[Any]:
    """A copy in a type that may not hold every number: losing more than digits is an error."""
    raw = np.asarray(value)
    if raw.dtype == dtype:
        return raw.copy()
    if np.issubdtype(dtype, np.integer) and raw.size and raw.dtype.kind not in "iub":
        raise ValueError(f"expected whole numbers, got {raw.dtype}")
    with np.errstate(over="raise", invalid="raise"):
        array: NDArray[Any] = np.array(raw, dtype=dtype)
    if array.dtype.kind in "iu" and not np.array_equal(array, raw):
        raise ValueError(f"some numbers do not fit {array.dtype}")
    return array


def finite(owner: str, name: str, array: NDArray[Any]) -> None:
    """Raise ``NotFiniteError`` when any entry is NaN or infinite."""
    # For the few numbers of a pose NumPy costs more than scalars.
    few = array.size <= 9
    fine = all(map(math.isfinite, array.ravel().tolist())) if few else np.isfinite(array).all()
    if not fine:
        raise NotFiniteError(f"{owner}.{name} must be finite, got {array.tolist()!r:.200}")


def pose(owner: str, name: str, value: ArrayLike) -> Float:
    """A frozen, finite ``(x, y, theta)``."""
    array = frozen(owner, name, value, (3,))
    if not math.isfinite(sum(array.tolist())):  # or their sum overflows
        finite(owner, name, array)
    return array


def possible(
    xx: float, xy: float, yy: float, xt: float = 0.0, yt: float = 0.0, tt: float = 0.0
) -> bool:
    """Whether these are of a covariance: positive semidefinite but for rounding.

    By its correlations; variances of (30 micrometres or microradians)^2 count as rounding.
    """
    x, y, t = math.sqrt(xx + 1e-9), math.sqrt(yy + 1e-9), math.sqrt(tt + 1e-9)
    a, b, c = xy / x / y, xt / x / t, yt / y / t
    within = max(abs(a), abs(b), abs(c)) <= 1.0 + 1e-6
    return within and 1.0 + 2.0 * a * b * c - a * a - b * b - c * c >= -1e-6


def covariance(owner: str, name: str, value: ArrayLike) -> Float:
    """A frozen, finite, symmetric, positive semidefinite (3, 3) covariance."""
    array = frozen(owner, name, value, (3, 3))
    # scalars: np.allclose on nine numbers costs more than a whole motion
    (xx, xy, xt), (yx, yy, yt), (tx, ty, tt) = array.tolist()
    if not math.isfinite(xx + xy + xt + yx + yy + yt + tx + ty + tt):  # or their sum overflows
        finite(owner, name, array)
    equal = (  # but for rounding
        abs(xy - yx) <= 1e-9 + 1e-6 * min(abs(xy), abs(yx))
        and abs(xt - tx) <= 1e-9 + 1e-6 * min(abs(xt), abs(tx))
        and abs(yt - ty) <= 1e-9 + 1e-6 * min(abs(yt), abs(ty))
    )
    if min(xx, yy, tt) < 0.0 or not equal:
        raise InvalidValueError(
            f"{owner}.{name} must be symmetric with variances >= 0, got {array.tolist()}"
        )
    if not possible(xx, xy, yy, xt, yt, tt):
        raise InvalidValueError(
            f"{owner}.{name} must be positive semidefinite (no correlations beyond 1), "
            f"got {array.tolist()}"
        )
    return array


def stamp(owner: str, value: object) -> int:
    """A whole number of nanoseconds that 64 bits hold; ``InvalidValueError`` for anything else."""
    if not is_whole(value):
        raise InvalidValueError(
            f"{owner}.stamp_ns must be an integer number of nanoseconds, got {value!r}"
        )
    if not -MOST_NS - 1 <= value <= MOST_NS:
        raise InvalidValueError(f"{owner}.stamp_ns must fit 64 bits, got {value}")
    return int(value)


def set_fields(owner: object, **values: object) -> None:
    """Give fields of a frozen dataclass what was checked of them, while it is made."""
    for name, value in values.items():
        object.__setattr__(owner, name, value)


class ByContent:
    """Equality of dataclasses that hold arrays: same type, equal fields, NaN equal to NaN."""

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        if type(self) is not type(other):
            return NotImplemented
        mine, theirs = vars(self), vars(other)
        return all(_same(mine[name], theirs[name]) for name in mine)

    __hash__ = None  # type: ignore[assignment]  # arrays have no hash


def _same(a: object, b: object) -> bool:
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        floats = a.dtype.kind == "f"
        return a.dtype == b.dtype and np.array_equal(a, b, equal_nan=floats)
    return bool(a == b)
