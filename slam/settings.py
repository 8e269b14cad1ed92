# SPDX-License-Identifier: Apache-2.0
"""Numbers with an address: frozen dataclasses whose fields say unit, meaning, source and bounds.

    @dataclass(frozen=True, kw_only=True)
    class Search(Settings):
        points: int = number(180, "points", "more add cost, not certainty", low=1)

A ``Settings`` may hold others: together they are a tree. Every number has a path in it such as
``matching.local.points``; ``rows`` lists all, ``changed`` sets some by path, ``sha256`` names the
whole.
"""

import dataclasses
import difflib
import hashlib
import importlib
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self, TypeVar

from slam.checked import is_number
from slam.errors import InvalidValueError, NotFiniteError, UnknownNameError

BY_HAND = "set by hand, not swept"  # a source as well: nobody has measured what the number does
_KEY = "setting"
S = TypeVar("S", bound="Settings")


@dataclass(frozen=True, kw_only=True)
class About:
    """What is known of one number; ``options`` are those of a word, which has no bounds."""

    unit: str
    meaning: str
    source: str
    low: float = -math.inf
    high: float = math.inf
    options: tuple[str, ...] = ()
    fixed: bool = False
    alias: str = ""


def number(  # noqa: PLR0913 (the facts of one number)
    default: float,
    unit: str,
    meaning: str,
    source: str = BY_HAND,
    *,
    low: float = 0.0,
    high: float = 1e6,
    fixed: bool = False,
    alias: str = "",
) -> Any:
    """A field of a ``Settings``; whole numbers where the default is one.

    ``low`` and ``high`` are allowed themselves. ``fixed``: a compiled kernel has it as a constant;
    it is printed and cannot be set. ``alias``: a second path for it.
    """
    about = About(
        unit=unit, meaning=meaning, source=source, low=low, high=high, fixed=fixed, alias=alias
    )
    return dataclasses.field(default=default, metadata={_KEY: about})


def word(
    default: str, options: tuple[str, ...], meaning: str, source: str = BY_HAND, *, alias: str = ""
) -> Any:
    """A field of a ``Settings`` that takes one of some words."""
    about = About(unit="word", meaning=meaning, source=source, options=options, alias=alias)
    return dataclasses.field(default=default, metadata={_KEY: about})


@dataclass(frozen=True)
class Row:
    """One number of a tree: its path, its value there, and what is known of it."""

    path: str
    value: Any
    about: About


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Base of every group of numbers: checked when made, frozen afterwards.

    Raises ``InvalidValueError`` that names group, field, value and what was expected.
    """

    presets: ClassVar[tuple[str, ...]] = ()  # names of class methods, each of which makes a tree
    gone: ClassVar[Mapping[str, str]] = {}  # paths of before, and what is set in their place
    constants: ClassVar[Mapping[str, str]] = {}  # groups: modules that have what left them

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            about = field.metadata.get(_KEY)
            if about is None:
                _check_group(type(self).__name__, field, value)
            else:
                checked = _checked(f"{type(self).__name__}.{field.name}", value, field, about)
                object.__setattr__(self, field.name, checked)

    def rows(self, prefix: str = "") -> Iterator[Row]:
        """Every number of the tree, in the order in which the fields are written."""
        for field in dataclasses.fields(self):
            value, about = getattr(self, field.name), field.metadata.get(_KEY)
            if about is None:
                yield from value.rows(f"{prefix}{field.name}.")
            else:
                yield Row(prefix + field.name, value, about)

    def changed(self, changes: Mapping[str, Any]) -> Self:
        """The same tree with the numbers at some paths replaced.

        "preset" is no path: where the tree has presets, that one is taken first, then changed.
        Raises ``UnknownNameError`` with the nearest path, ``InvalidValueError`` for a value that
        cannot be or a number that is fixed.
        """
        if self.presets and "preset" in changes:
            rest = {path: value for path, value in changes.items() if path != "preset"}
            return self.preset(changes["preset"]).changed(rest)
        known = {row.path: row for row in self.rows()}
        aliases = {row.about.alias: row.path for row in known.values() if row.about.alias}
        nested: dict[str, Any] = {}
        for given, value in changes.items():
            path = aliases.get(given, given)
            if path not in known:
                raise UnknownNameError(_no_path(type(self), given, [*known, *aliases]))
            if known[path].about.fixed:
                raise InvalidValueError(
                    f"{type(self).__name__}: '{path}' is fixed at {known[path].value}: a compiled "
                    "kernel has it as a constant"
                )
            at = nested
            *groups, name = path.split(".")
            for group in groups:
                at = at.setdefault(group, {})
            if name in at:
                raise InvalidValueError(f"{type(self).__name__}: '{path}' is set twice")
            at[name] = value
        return _replaced(self, nested)

    @classmethod
    def preset(cls, name: Any) -> Self:
        """The tree of one of the ``presets``; raises ``UnknownNameError`` for any other name."""
        if name not in cls.presets:
            raise UnknownNameError(
                f"{cls.__name__} has no preset {name!r:.40}; it has {', '.join(cls.presets)}"
            )
        made: Self = getattr(cls, name)()
        return made

    def differences(self, other: "Settings") -> dict[str, Any]:
        """By path: the numbers that are not as in ``other``, a tree of the same shape."""
        theirs = {row.path: row.value for row in other.rows()}
        return {row.path: row.value for row in self.rows() if row.value != theirs.get(row.path)}

    def as_words(self) -> dict[str, Any]:
        """The tree as nested dictionaries of numbers and words, for JSON."""
        return dataclasses.asdict(self)

    @classmethod
    def from_words(cls, words: Any) -> Self:
        """The tree of ``as_words``; what it lacks has its default.

        Raises ``InvalidValueError`` for what is no tree of this shape.
        """
        if not isinstance(words, Mapping):
            raise InvalidValueError(f"{cls.__name__} must be an object, got {words!r:.80}")
        fields = {field.name: field for field in dataclasses.fields(cls)}
        values: dict[str, Any] = {}
        for name, value in words.items():
            if name not in fields:
                raise InvalidValueError(_no_path(cls, str(name), list(fields)))
            group = _group(fields[name])
            values[name] = value if group is None else group.from_words(value)
        return cls(**values)

    def sha256(self) -> str:
        """Of the tree as canonical JSON: equal for equal trees, in every process."""
        text = json.dumps(self.as_words(), sort_keys=True, separators=(",", ":"), allow_nan=False)
        return hashlib.sha256(text.encode()).hexdigest()


def _group(field: dataclasses.Field[Any]) -> type[Settings] | None:
    """The type of a field that holds a group of numbers."""
    if _KEY in field.metadata:
        return None
    default = field.default
    assert isinstance(default, Settings), f"{field.name} holds neither a number nor Settings"
    return type(default)


def _check_group(owner: str, field: dataclasses.Field[Any], value: Any) -> None:
    group = _group(field)
    if group is not None and not isinstance(value, group):
        raise InvalidValueError(f"{owner}.{field.name} must be a {group.__name__}, got {value!r}")


def _checked(name: str, value: Any, field: dataclasses.Field[Any], about: About) -> Any:
    """``value`` as a float, whole number or word; the one place where that is judged."""
    if about.options:
        if not isinstance(value, str) or value not in about.options:
            known = " or ".join(repr(option) for option in about.options)
            raise InvalidValueError(f"{name} must be {known}, got {value!r}")
        return value
    whole = isinstance(field.default, int)
    if not is_number(value) or math.isnan(value):
        raise InvalidValueError(f"{name} must be a number, got {value!r}")
    if not about.low <= value <= about.high:
        raise InvalidValueError(f"{name} must lie in [{about.low}, {about.high}], got {value}")
    if math.isinf(value):
        raise NotFiniteError(f"{name} must be finite, got {value}")
    if whole and value != int(value):
        raise InvalidValueError(f"{name} must be a whole number, got {value!r}")
    if about.fixed and value != field.default:
        raise InvalidValueError(f"{name} is fixed at {field.default}, got {value!r}")
    return int(value) if whole else float(value)


def _no_path(owner: type[Settings], given: str, known: list[str]) -> str:
    if given in owner.gone:
        return f"{owner.__name__} has no '{given}' any more; set '{owner.gone[given]}'"
    group, _, last = given.rpartition(".")
    home = owner.constants.get(group, "")
    if home and hasattr(importlib.import_module(home), last.upper()):
        return f"{owner.__name__}: '{given}' is a constant now: {last.upper()} of {home}"
    near = difflib.get_close_matches(given, known, n=1, cutoff=0.5)
    if not near:  # the right name in another group
        near = [path for path in known if path.rpartition(".")[2] == last][:1]
    groups = dict.fromkeys(path.partition(".")[0] for path in known)
    hint = f" Did you mean '{near[0]}'?" if near else f" It has: {', '.join(groups)}."
    return f"{owner.__name__} has no '{given}'.{hint}"


def _replaced(tree: S, nested: Mapping[str, Any]) -> S:
    values = {
        name: _replaced(getattr(tree, name), value) if isinstance(value, dict) else value
        for name, value in nested.items()
    }
    return dataclasses.replace(tree, **values)
