# SPDX-License-Identifier: Apache-2.0
"""Scores of age: a session in maps some sessions old, and whether the SLAM says so."""

from __future__ import annotations

import math
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.kinds import is_door
from scripts.comparison.recording import Recording
from scripts.comparison.schema import OLD as AGES
from scripts.comparison.sight import Sight
from scripts.days.truth import Still, moved_since, still_things
from slam.estimate import Estimate
from slam.frames import NS_PER_S, Float
from slam.tracker.belief.status import Status

NEWS_S = 2.0  # after which the map has learnt what it saw
CLEARLY, HARDLY = 0.1, 0.01  # share of a scan's beams that what changed has met or let pass
COLUMNS = ("slam", "age", "session", "found_after_s", "place", "rmse_m", "worst_m", "tracked")


def keep_copy(map_file: Path, folder: Path, number: int) -> Path:
    """The map as it is after that session."""
    folder.mkdir(parents=True, exist_ok=True)
    return Path(shutil.copyfile(map_file, folder / f"{map_file.stem}_{number}.npz"))


def ages_of(copies: Sequence[int], number: int) -> Iterator[tuple[int, int]]:
    """(age, session after which the map was kept) for a session of that number, of ``AGES``.

    A map that is kept apart from a session is missing: the one before is older than its age says.
    """
    for age in AGES:
        before = [k for k in copies if k <= number - age]
        if number - age >= 0 and before:
            yield age, max(before)


def changed_share(before: Recording, now: Recording) -> Float:
    """(scans,) share of the beams with a return that met a thing where it did not stand in the
    session ``before``, or passed through the place that one has left; each while it is news, for
    ``NEWS_S`` from its first beam on. Then the map has learnt it.
    """
    old, new = still_things(before), still_things(now)
    came = [thing for thing in new if moved_since(thing, old)]
    went = [thing for thing in old if moved_since(thing, new)]
    first_ns: dict[int, int] = {}
    shares = np.zeros(len(now.frames))
    for k, frame in enumerate(now.frames):
        sight = Sight(now, k)
        returned: NDArray[np.bool_] = np.asarray(np.isfinite(sight.points).all(axis=1))
        news: NDArray[np.bool_] = np.zeros(len(returned), dtype=np.bool_)
        beams = [now.hit[k] == t.row for t in came] + [_passed(sight, t) for t in went]
        for number, met in enumerate(beams):
            if met.any():
                since = first_ns.setdefault(number, frame.stamp_ns)
                if frame.stamp_ns - since <= NEWS_S * NS_PER_S:
                    news = news | (met & returned)
        shares[k] = news.sum() / max(returned.sum(), 1)
    return shares


def _passed(sight: Sight, thing: Still) -> NDArray[np.bool_]:
    """(beams,) which went through where a thing stood, and beyond."""
    away = sight.points - sight.eye
    length = np.hypot(away[:, 0], away[:, 1])
    to = np.array(thing.middle()) - sight.eye
    radius = thing.radius_m * (0.5 if is_door(thing.kind) else 1.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        along = away @ to / length
        aside = np.abs(away[:, 0] * to[1] - away[:, 1] * to[0]) / length
        met = (aside < radius) & (along > 0.0) & (length > math.hypot(*to) + radius)
    return np.asarray(met, dtype=np.bool_)


def verdicts(estimates: Sequence[Estimate], shares: Float, first: int) -> dict[str, Any]:
    """From scan ``first`` on: how often "map outdated here" is said where the room clearly changed,
    and where it hardly did; None without such scans.
    """
    said = np.array([e.diagnostics.get("verdict") == Status.OUTDATED for e in estimates])[first:]
    shares = shares[first:]
    clearly, hardly = shares >= CLEARLY, shares < HARDLY
    return {
        "outdated_told": float(said[clearly].mean()) if clearly.any() else None,
        "outdated_false": float(said[hardly].mean()) if hardly.any() else None,
    }
