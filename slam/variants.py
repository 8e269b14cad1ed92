# SPDX-License-Identifier: Apache-2.0
"""A SLAM's name with numbers set: ``shunting{matching.reward=7}``, ``ekf{preset=corners}``.

Such a variant may be named wherever a SLAM is: ``create``, ``--slam``, recipes. Values are JSON, or
words without quotes.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from slam.errors import InvalidValueError

PIPE = "pipe:"  # what follows is a command, which may hold braces of its own


def parsed(name: str) -> tuple[str, dict[str, Any]]:
    """The SLAM's own name, and values by path: empty for a name without braces.

    Raises ``InvalidValueError`` for what is not ``path=value,...`` in the braces.
    """
    base, brace, rest = name.partition("{")
    if not brace or name.startswith(PIPE):
        return name, {}
    if not rest.endswith("}"):
        raise InvalidValueError(f"SLAM '{name}': '{{' without '}}' at the end")
    changes: dict[str, Any] = {}
    for word in rest[:-1].split(","):
        path, value = assignment(word, f"SLAM '{name}'")
        if path in changes:
            raise InvalidValueError(f"SLAM '{name}': '{path}' is set twice")
        changes[path] = value
    return base, changes


def assignment(word: str, where: str) -> tuple[str, Any]:
    """``("matching.reward", 7)`` of "matching.reward=7"."""
    path, equals, value = word.strip().partition("=")
    if not equals or not path or not value:
        raise InvalidValueError(f"{where}: expected PATH=VALUE, got {word!r}")
    try:
        return path.strip(), json.loads(value)
    except json.JSONDecodeError:
        return path.strip(), value.strip()


def named(base: str, changes: Mapping[str, Any]) -> str:
    """The name of a variant; ``base`` itself where nothing changes."""
    if not changes:
        return base
    words = (f"{path}={_word(changes[path])}" for path in sorted(changes))
    return f"{base}{{{','.join(words)}}}"


def _word(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value)


def with_set(names: Sequence[str], words: Sequence[str]) -> tuple[str, ...]:
    """The names with each of the words "[SLAM.]PATH=VALUE" (``--set``) in the SLAM that it is for.

    With one SLAM beside "odometry" the prefix may be left out. Raises ``InvalidValueError`` where
    several SLAMs could be meant, or none of that name runs, and ``UnknownNameError`` with the
    nearest path for one that a registered SLAM does not have.
    """
    from slam.system import config_of
    from slam.system import names as registered

    changes = {name: dict[str, Any]() for name in names}
    able = [name for name in changes if name != "odometry"]
    for word in words:
        path, value = assignment(word, "--set")
        first, _, rest = path.partition(".")
        meant = [name for name in able if parsed(name)[0] == first] if rest else []
        if meant:
            path = rest
        elif rest and first in registered():
            raise InvalidValueError(
                f"--set {word}: '{first}' does not run; these run: {', '.join(names)}. "
                f"Did you mean '--set {word.partition('.')[2]}'?"
            )
        elif len(able) == 1:
            meant = able
        else:
            raise InvalidValueError(
                f"--set {word}: which SLAM? Write --set {able[0] if able else 'SLAM'}.{word}; "
                f"these run: {', '.join(names)}"
            )
        for name in meant:
            if path in changes[name]:
                raise InvalidValueError(f"--set: '{path}' is set twice")
            changes[name][path] = value
    variants = tuple(_with(name, changes[name]) for name in names)
    for name, variant in zip(names, variants, strict=True):
        if changes[name] and ":" not in parsed(name)[0]:
            config_of(variant)
    return variants


def _with(name: str, more: Mapping[str, Any]) -> str:
    if not more:
        return name
    base, own = parsed(name)
    return named(base, {**own, **more})
