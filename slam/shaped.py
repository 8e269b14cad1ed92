# SPDX-License-Identifier: Apache-2.0
"""Values against types, by the msgspec library: what a file says, and fields of a dataclass.

class Laser(Table):
    yaw_deg: Annotated[float, Meta(ge=-360.0, le=360.0)] = 0.0

laser = shaped("", {"yaw_deg": 400}, Laser)
# InvalidValueError: yaw_deg must be a number from -360 to 360, got 400
"""

import re
import sys
from collections.abc import Collection
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Annotated, Any, cast, get_type_hints

import msgspec
import numpy as np
from msgspec import Meta, inspect

from slam.errors import InvalidValueError

MOST = sys.float_info.max
Number = Annotated[float, Meta(ge=-MOST, le=MOST)]  # any finite one
Positive = Annotated[float, Meta(gt=0.0, le=MOST)]
NotNegative = Annotated[float, Meta(ge=0.0, le=MOST)]
Share = Annotated[float, Meta(ge=0.0, le=1.0)]
PRINTABLE = r"\A[^\x00-\x1f\x7f-\x9f\u2028\u2029]*\Z"  # pattern of words without control characters
_MANY = (inspect.ListType, inspect.VarTupleType)
_OBJECT = (inspect.StructType, inspect.DataclassType)


class Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Base of what a table of a file holds; keys that it does not know are refused."""


def shaped(owner: str, value: Any, kind: Any) -> Any:
    """``value`` as a ``kind``: a number, word, list, ``Table`` or union, with its bounds.

    owner  what the value is, for the error
    Raises ``InvalidValueError`` that names the field, what was expected, and the value.
    """
    value = _plain(value)
    try:
        return msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        said, _, place = str(error).partition(" - at `$")
        raise InvalidValueError(_told(owner, value, inspect.type_info(kind), said, place)) from None


def within(owner: str, value: Any, low: float, high: float) -> float:
    """``value`` as a float; ``InvalidValueError`` unless it is a number in [low, high]."""
    return float(shaped(owner, value, Annotated[float, Meta(ge=low, le=high)]))


def one_of(owner: str, value: Any, known: Collection[str]) -> str:
    """``value``; ``InvalidValueError`` unless it is one of these words."""
    if not isinstance(value, str) or value not in known:
        raise InvalidValueError(f"{owner} must be one of {', '.join(known)}, got {value!r:.200}")
    return value


def instance(owner: str, value: Any, kind: type) -> None:
    """Raise ``InvalidValueError`` unless ``value`` is of that class."""
    if not isinstance(value, kind):
        raise InvalidValueError(f"{owner} must be a {kind.__name__}, got {value!r:.80}")


def check(config: Any) -> None:
    """Raise ``InvalidValueError`` for a field of a dataclass that is none of its annotation."""
    name, kinds = type(config).__name__, _fields(config.__class__)
    values = {field.name: getattr(config, field.name) for field in fields(config)}
    for field, kind in kinds.__annotations__.items():
        if is_dataclass(kind):  # a table of its fields will not do
            instance(f"{name}.{field}", values[field], cast(type, kind))
    shaped(name, {k: _plain(v) for k, v in values.items()}, kinds)


def _plain(value: Any) -> Any:
    """Without NumPy's scalars, in a tuple too."""
    if isinstance(value, tuple):
        return tuple(map(_plain, value))
    return value.item() if isinstance(value, np.generic) else value


@cache
def _fields(of: type) -> type[msgspec.Struct]:
    hints = get_type_hints(of, include_extras=True)
    return msgspec.defstruct(of.__name__, [(f.name, hints[f.name]) for f in fields(of)])


def _told(owner: str, value: Any, kind: inspect.Type, said: str, place: str) -> str:
    """What is wrong at a place such as ``.laser.x`` or ``[3][1]`` of a value."""
    for name, at in re.findall(r"\.(\w+)|\[(\d+)\]", place):
        kind = _holding(kind, value)
        if name:
            owner = f"{owner}.{name}" if owner else name
            value = value[name]
            kind = next(f.type for f in kind.fields if f.encode_name == name)  # type: ignore[attr-defined]
        else:
            owner, value = f"{owner}[{at}]", value[int(at)]
            kind = kind.item_type if isinstance(kind, _MANY) else kind.item_types[int(at)]  # type: ignore[attr-defined]
    kind, key = _holding(kind, value), re.search(r"field `(.*)`", said)
    if key and isinstance(kind, _OBJECT):
        known = {f.encode_name: f.type for f in kind.fields}
        if key[1] not in known:
            where = f"{owner}: " if owner else ""
            return f"{where}unknown key {key[1]!r:.80}; known: {', '.join(known)}"
        where = f"{owner}.{key[1]}" if owner else key[1]
        return f"{where} must be {wanted(known[key[1]])}, got nothing"
    return f"{owner} must be {wanted(kind)}, got {value!r:.80}"


def _holding(kind: inspect.Type, value: Any) -> inspect.Type:
    """Of several types the one that may hold such a value."""
    if isinstance(kind, inspect.UnionType) and isinstance(value, (dict, list, tuple)):
        sort = _OBJECT if isinstance(value, dict) else (*_MANY, inspect.TupleType)
        return next((one for one in kind.types if isinstance(one, sort)), kind)
    return kind


def wanted(kind: inspect.Type) -> str:
    """A type in words."""
    if isinstance(kind, inspect.UnionType):
        return " or ".join(map(wanted, kind.types))
    if isinstance(kind, (inspect.IntType, inspect.FloatType)):
        finite = "finite " if kind.le == MOST else ""
        number = "whole number" if isinstance(kind, inspect.IntType) else "number"
        return f"a {finite}{number}{_bounds(kind)}"
    if isinstance(kind, inspect.LiteralType):
        return f"one of {', '.join(map(str, kind.values))}" if len(kind.values) > 1 else str(
            kind.values[0]
        )  # fmt: skip
    if isinstance(kind, inspect.TupleType):
        words = list(map(wanted, kind.item_types))
        each = f", each {words[0]}" if len(set(words)) == 1 else f": {', '.join(words)}"
        return f"{len(words)} values{each}"
    if isinstance(kind, inspect.StrType) and kind.pattern not in (None, PRINTABLE):
        return f"a word that matches {kind.pattern}"
    if isinstance(kind, (*_MANY, inspect.StrType)):
        what = "letters" if isinstance(kind, inspect.StrType) else "values"
        sort = "a word" if what == "letters" else "a list"
        least, most = kind.min_length or 0, kind.max_length
        few = f" of {least} to {most} {what}" if most is not None else f" of {least} {what} or more"
        return sort + few if least or most is not None else sort
    if isinstance(kind, _OBJECT):
        return f"a {kind.cls.__name__}" if isinstance(kind, inspect.DataclassType) else "a table"
    return {"BoolType": "True or False", "NoneType": "None"}.get(
        type(kind).__name__, "another type"
    )


def _bounds(kind: inspect.IntType | inspect.FloatType) -> str:
    """`` from 0 to 1`` or `` > 0``."""
    low, high = (None if bound in (-MOST, MOST) else bound for bound in (kind.ge, kind.le))
    if low is not None and high is not None:
        return f" from {low:g} to {high:g}"
    words = [(">", kind.gt), (">=", low), ("<", kind.lt), ("<=", high)]
    return "".join(f" {mark} {bound:g}" for mark, bound in words if bound is not None)
