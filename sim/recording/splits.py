# SPDX-License-Identifier: Apache-2.0
"""Training, validation and test parts of a dataset: no seed is in two of them."""

import re
from collections.abc import Sequence

from slam.errors import InvalidValueError

Split = tuple[tuple[str, int], ...]
MOST_PARTS = 20
_NAME = re.compile(r"[a-z][a-z0-9_]{0,30}")


def checked_split(value: object) -> Split:
    """(name, number of seeds) of each part, in the order of the seeds; () for no parts.

    Raises ``InvalidValueError`` for anything else.
    """
    wanted = "names with numbers of episodes >= 1, each name once: train:8,validation:1,test:1"
    try:
        parts = tuple((name, count) for name, count in value)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        raise InvalidValueError(f"Plan.split must be {wanted}, got {value!r:.80}") from None
    names = [name for name, _ in parts]
    good = all(
        isinstance(name, str)
        and _NAME.fullmatch(name)
        and isinstance(count, int)
        and not isinstance(count, bool)
        and count >= 1
        for name, count in parts
    )
    if not good or len(set(names)) != len(names) or len(parts) > MOST_PARTS:
        raise InvalidValueError(f"Plan.split must be {wanted}, got {value!r:.80}")
    return parts


def split_of(text: str) -> Split:
    """Of the words of an option: ``train:8,validation:1,test:1``; () for nothing."""
    try:
        words = [word.split(":") for word in text.split(",") if word]
        return checked_split([(name.strip(), int(count)) for name, count in words])
    except ValueError:  # ours is one, too
        return checked_split(text)


def part_of(split: Split, k: int) -> str:
    """The part that the ``k``-th seed is in; "" without parts."""
    for name, count in split:
        if k < count:
            return name
        k -= count
    return ""


def file_of(name: str) -> str:
    """The list of the episodes of a part."""
    return f"{name}.txt"


def list_text(episodes: Sequence[str]) -> str:
    """Folder by folder, a line each."""
    return "".join(f"{name}\n" for name in episodes)
