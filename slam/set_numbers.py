# SPDX-License-Identifier: Apache-2.0
"""``--set PATH=VALUE``: numbers put into the names of the SLAMs that run."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from slam.errors import InvalidValueError
from slam.system import config_of
from slam.system import names as registered
from slam.variants import assignment, inside, named, oracle_named, oracle_of, parsed


def with_set(names: Sequence[str], words: Sequence[str]) -> tuple[str, ...]:
    """The names with each of the words "[SLAM.]PATH=VALUE" (``--set``) in the SLAM that it is for.

    With one SLAM beside "odometry" the prefix may be left out; a SLAM and its oracle are one, and
    both get the numbers. Raises ``InvalidValueError`` where several SLAMs could be meant, or none
    of that name runs, and ``UnknownNameError`` with the nearest path for one that a registered SLAM
    does not have.
    """
    changes = {name: dict[str, Any]() for name in names}
    able = [name for name in changes if inside(name) != "odometry"]
    for word in words:
        path, value = assignment(word, "--set")
        first, _, rest = path.partition(".")
        meant = [name for name in able if parsed(inside(name))[0] == first] if rest else []
        if meant:
            path = rest
        elif rest and first in registered():
            raise InvalidValueError(
                f"--set {word}: '{first}' does not run; these run: {', '.join(names)}. "
                f"Did you mean '--set {word.partition('.')[2]}'?"
            )
        elif len({inside(name) for name in able}) == 1:
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
    variants = tuple(with_numbers(name, changes[name]) for name in names)
    for name, variant in zip(names, variants, strict=True):
        if changes[name] and ":" not in parsed(name)[0]:
            try:
                config_of(variant)
            except InvalidValueError as error:
                said = re.sub(r"^\w+\.", "", str(error))  # without the class of the field
                raise InvalidValueError(f"--set: {said}") from error
    return variants


def with_numbers(name: str, more: Mapping[str, Any]) -> str:
    """The name of a SLAM, or of an oracle of one, with these numbers beside its own."""
    if not more:
        return name
    if (found := oracle_of(name)) is not None:
        return oracle_named(f"{with_numbers(found[0], more)},{found[1]}")
    base, own = parsed(name)
    return named(base, {**own, **more})
