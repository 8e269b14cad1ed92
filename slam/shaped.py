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

from slam.errors import InvalidValueError, meant

MOST = sys.float_info.max
FAR_M = 1e6  # no place of a scene is farther away
MOST_LETTERS = 100  # of a name
# pattern of words without control characters, ends of lines or marks that turn the reading
PRINTABLE = (
    r"\A[^\x00-\x1f\x7f-\x9f\xad\u200b-\u200f\u2028-\u202e\u2060-\u2069\ufeff\ud800-\udfff]*\Z"
)
Number = Annotated[float, Meta(ge=-MOST, le=MOST)]  # any finite one
Positive = Annotated[float, Meta(gt=0.0, le=MOST)]
NotNegative = Annotated[float, Meta(ge=0.0, le=MOST)]
Share = Annotated[float, Meta(ge=0.0, le=1.0)]
Word = Annotated[str, Meta(max_length=MOST_LETTERS, pattern=PRINTABLE)]
Metres = Annotated[float, Meta(ge=-FAR_M, le=FAR_M)]
Point = tuple[Metres, Metres, Metres]
Pose = Annotated[
    tuple[Number, Number, Number],
    Meta(description="three finite numbers (x m, y m, heading rad)"),
]
_MANY = (inspect.ListType, inspect.VarTupleType)
_OBJECT = (inspect.StructType, inspect.DataclassType)


class Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Base of what a table of a file holds; keys that it does not know are refused."""


def shaped(owner: str, value: Any, kind: Any, *, strict: bool = True) -> Any:
    """``value`` as a ``kind``: a number, word, list, ``Table`` or union, with its bounds.

    owner   what the value is, for the error
    strict  else a number may be given as its text, as in the cells of a table
    Raises ``InvalidValueError`` that names the field, what was expected, and the value.
    """
    value = _plain(value)
    try:
        return msgspec.convert(value, kind, strict=strict)
    except msgspec.ValidationError as error:
        said, _, place = str(error).partition(" - at `$")
        raise InvalidValueError(_told(owner, value, inspect.type_info(kind), said, place)) from None


def within(owner: str, value: Any, low: float, high: float) -> float:
    """``value`` as a float; ``InvalidValueError`` unless it is a number in [low, high]."""
    return float(shaped(owner, value, Annotated[float, Meta(ge=low, le=high)]))


def whole(owner: str, value: Any, least: int, most: int) -> int:
    """``value``; ``InvalidValueError`` unless it is a whole number from ``least`` to ``most``."""
    return int(shaped(owner, value, Annotated[int, Meta(ge=least, le=most)]))


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
    """Without NumPy's scalars and arrays, in a tuple too."""
    if isinstance(value, tuple):
        return tuple(map(_plain, value))
    return value.tolist() if isinstance(value, np.generic | np.ndarray) else value


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
    told, key = _holding(kind, value), re.search(r"field `(.*)`", said)
    if key and isinstance(told, _OBJECT):
        known = {f.encode_name: f.type for f in told.fields}
        if key[1] not in known:
            where = f"{owner}: " if owner else ""
            near = meant(key[1], known)
            return f"{where}unknown key {key[1]!r:.80}; known: {', '.join(known)}.{near}"
        where = f"{owner}.{key[1]}" if owner else key[1]
        return f"{where} must be {wanted(known[key[1]])}, got nothing"
    return f"{owner} must be {wanted(kind)}, got {value!r:.80}"


def _holding(kind: inspect.Type, value: Any) -> inspect.Type:
    """Of several types the one that may hold such a value, without its words."""
    if isinstance(kind, inspect.UnionType) and isinstance(value, (dict, list, tuple)):
        sort = _OBJECT if isinstance(value, dict) else (*_MANY, inspect.TupleType)
        bare = (_holding(one, value) for one in kind.types)
        return next((one for one in bare if isinstance(one, sort)), kind)
    return _holding(kind.type, value) if isinstance(kind, inspect.Metadata) else kind


def wanted(kind: inspect.Type) -> str:
    """A type in words, which its ``Meta`` may give as ``description``."""
    match kind:
        case inspect.Metadata():
            return str((kind.extra_json_schema or {})["description"])
        case inspect.UnionType():
            return " or ".join(map(wanted, kind.types))
        case inspect.IntType() | inspect.FloatType():
            finite = "finite " if kind.le == MOST else ""
            number = "whole number" if isinstance(kind, inspect.IntType) else "number"
            return f"a {finite}{number}{_bounds(kind)}"
        case inspect.LiteralType():
            known = ", ".join(map(str, kind.values))
            return f"one of {known}" if len(kind.values) > 1 else known
        case inspect.TupleType():
            words = list(map(wanted, kind.item_types))
            each = f", each {words[0]}" if len(set(words)) == 1 else f": {', '.join(words)}"
            return f"{len(words)} values{each}"
        case inspect.StrType():
            free = kind.pattern in (None, PRINTABLE)
            return f"a word{_length(kind, 'letters') if free else f' that matches {kind.pattern}'}"
        case inspect.ListType() | inspect.VarTupleType():
            return f"a list{_length(kind, 'values')}"
        case inspect.StructType() | inspect.DictType():
            return "a table"
    own = f"a {kind.cls.__name__}" if isinstance(kind, inspect.DataclassType) else "another type"
    return {"BoolType": "True or False", "NoneType": "None"}.get(type(kind).__name__, own)


def _length(kind: inspect.StrType | inspect.ListType | inspect.VarTupleType, what: str) -> str:
    least, most = kind.min_length or 0, kind.max_length
    if most is not None:
        return f" of {least} to {most} {what}" if least < most else f" of {most} {what}"
    return f" of {least} or more {what}" if least else ""


def _bounds(kind: inspect.IntType | inspect.FloatType) -> str:
    """`` from 0 to 1`` or `` > 0``."""
    low, high = (None if bound in (-MOST, MOST) else bound for bound in (kind.ge, kind.le))
    if low is not None and high is not None:
        return f" from {low:g} to {high:g}"
    words = [(">", kind.gt), (">=", low), ("<", kind.lt), ("<=", high)]
    return " and".join(f" {mark} {bound:g}" for mark, bound in words if bound is not None)
