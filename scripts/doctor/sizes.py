# SPDX-License-Identifier: Apache-2.0
"""What the virtual environment is made of: bytes of every package, and who needs it."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from importlib import metadata

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from scripts.doctor.checks import EXTRAS, PACKAGE, required

DEMO = "mobilia"  # what ``make demo`` and every verb need
OTHER = "development"  # tests, linters, and what somebody else has put there


@dataclass(frozen=True, kw_only=True)
class Size:
    """An installed package: its files in MB (10^6 bytes), and for whom it is there."""

    name: str
    version: str
    megabytes: float
    group: str


def sizes() -> list[Size]:
    """Every installed package, largest first; links and what is shared count once each."""
    groups = _groups()
    found = {}
    for one in metadata.distributions():
        name = canonicalize_name(one.metadata["Name"])
        if name not in found:
            group = groups.get(name, OTHER)
            found[name] = Size(
                name=name, version=one.version, megabytes=_bytes(one) / 1e6, group=group
            )
    return sorted(found.values(), key=lambda size: (-size.megabytes, size.name))


def totals(found: Iterable[Size]) -> dict[str, float]:
    """MB of each group."""
    sums: dict[str, float] = {}
    for size in found:
        sums[size.group] = sums.get(size.group, 0.0) + size.megabytes
    return sums


def _groups() -> dict[str, str]:
    """By package the first that needs it: mobilia itself, then its extras."""
    groups = {PACKAGE: DEMO}
    for name in _closure(required()):
        groups.setdefault(name, DEMO)
    for extra in EXTRAS:
        for name in _closure(required(extra)):
            groups.setdefault(name, f"[{extra}]")
    return groups


def _closure(wanted: Iterable[Requirement]) -> list[str]:
    """Names of the installed packages that these need, directly or not."""
    seen: list[str] = []
    waiting = [(canonicalize_name(one.name), frozenset(one.extras)) for one in wanted]
    done = set()
    while waiting:
        name, extras = waiting.pop()
        if (name, extras) in done:
            continue
        done.add((name, extras))
        try:
            below = metadata.requires(name) or []
        except metadata.PackageNotFoundError:
            continue
        seen.append(name)
        for one in map(Requirement, below):
            if one.marker is None or any(
                one.marker.evaluate({"extra": extra}) for extra in ("", *extras)
            ):
                waiting.append((canonicalize_name(one.name), frozenset(one.extras)))
    return seen


def _bytes(one: metadata.Distribution) -> int:
    total = 0
    for file in one.files or ():
        try:
            total += os.lstat(file.locate()).st_size
        except OSError:  # listed, and not there: a cache that somebody removed
            continue
    return total
