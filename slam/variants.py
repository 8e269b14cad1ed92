# SPDX-License-Identifier: Apache-2.0
"""A SLAM's name with numbers set: ``shunting{matching.reward=7}``, ``ekf{preset=corners}``.

Such a variant may be named wherever a SLAM is: ``create``, ``--slam``, recipes. Values are JSON, or
words without quotes. An oracle (``slam.oracle``) has the name of the SLAM in it:
``oracle(shunting{matching.reward=7},moving)``.
"""

import json
from collections.abc import Mapping
from typing import Any

from slam.errors import InvalidValueError

PIPE = "pipe:"  # what follows is a command, which may hold braces of its own
COMMANDS = (PIPE, "ros2:", "ros2-zenoh:")  # and behind these
ORACLE = "oracle("
MAP_ORACLE = "oracle(map)"  # no SLAM in it: scan matching to the true map (slam.oracle_map)
TAKEN_OUT = ("movable", "moving")  # returns that an oracle takes out, the default first


def parsed(name: str) -> tuple[str, dict[str, Any]]:
    """The SLAM's own name, and values by path: empty for a name without braces, or an oracle's.

    Raises ``InvalidValueError`` for what is not ``path=value,...`` in the braces.
    """
    base, brace, rest = name.partition("{")
    if not brace or name.startswith((*COMMANDS, ORACLE)):
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


def oracle_of(name: str) -> tuple[str, str] | None:
    """``("shunting", "moving")`` of "oracle(shunting,moving)"; None for the name of no oracle.

    Raises ``InvalidValueError`` for one without a SLAM, with another last word, or of an oracle.
    """
    if not name.startswith(ORACLE):
        return None
    words = name[len(ORACLE) : -1]
    if not name.endswith(")"):
        raise InvalidValueError(f"SLAM '{name}': '{ORACLE}' without ')' at the end")
    slam, comma, last = words.rpartition(",")
    takes_out = last.strip()
    if not comma or takes_out not in TAKEN_OUT:
        if comma and ":" not in words and "}" not in last:
            raise InvalidValueError(
                f"SLAM '{name}': an oracle takes out {' or '.join(TAKEN_OUT)} returns, "
                f"got {takes_out!r}"
            )
        slam, takes_out = words, TAKEN_OUT[0]
    slam = slam.strip()
    if not slam or slam.startswith(ORACLE):
        raise InvalidValueError(f"SLAM '{name}': expected oracle(SLAM) of a SLAM that is no oracle")
    return slam, takes_out


def inside(name: str) -> str:
    """The SLAM within an oracle; any other name as it is."""
    found = oracle_of(name)
    return name if found is None else found[0]


def oracle_named(word: str) -> str:
    """The oracle's name of "SLAM" or "SLAM,moving", as ``--oracle`` takes it.

    The default is left out of it. Raises as ``oracle_of`` does.
    """
    slam, takes_out = oracle_of(f"{ORACLE}{word})") or ("", "")
    short = f"{ORACLE}{slam})"
    return short if oracle_of(short) == (slam, takes_out) else f"{ORACLE}{slam},{takes_out})"


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
