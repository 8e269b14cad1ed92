# SPDX-License-Identifier: Apache-2.0
"""The numbers of maps that live for days."""

from __future__ import annotations

from dataclasses import dataclass, field

from slam.settings import Settings, number


@dataclass(frozen=True, kw_only=True)
class EvidenceConfig(Settings):
    """What one session says of each place."""

    cell_m: float = number(0.1, "m", "edge of a place", low=0.02, high=1.0)
    every_s: float = number(0.2, "s", "between two scans that are counted", low=0.0, high=100.0)
    range_m: float = number(8.0, "m", "farthest return that is counted", low=1.0, high=100.0)
    margin_m: float = number(0.15, "m", "before a return that is not yet known to be empty")
    least_looks: int = number(5, "scans", "a place seen less often stays unknown", low=1)
    sessions: int = number(64, "sessions", "kept in a map file; older ones go", low=1, high=1000)


@dataclass(frozen=True, kw_only=True)
class SearchConfig(Settings):
    """Finding the start of a session in the map of the days before."""

    step_m: float = number(0.02, "m", "deviation of the motion between two scans", low=1e-6)
    step_rad: float = number(0.01, "rad", "the same of the turn", low=1e-6)
    buffer: int = number(200, "scans", "kept to be merged when the place is found", low=1)
    buffer_m: float = number(0.1, "m", "driven between two of them, or buffer_rad")
    buffer_rad: float = number(0.15, "rad", "turned between two of them, or buffer_m")
    asked: int = number(
        20, "scans", "of those kept, evenly taken, that a place found late is asked for", low=1
    )
    agreed: float = number(
        0.75, "share", "of the usual match, in a map without days, of those asked", high=1.0
    )
    fits: float = number(0.5, "share", "of the scans after the find that must be tracked", high=1.0)


@dataclass(frozen=True, kw_only=True)
class AgreementConfig(Settings):
    """Whether what a session saw fits the days before."""

    always: float = number(0.7, "share", "of the looks of all sessions: always stands", high=1.0)
    stands: float = number(0.5, "share", "of a session's looks: something stands", high=1.0)
    empty: float = number(0.2, "share", "most of the looks, around it too: nothing", high=1.0)
    slack: int = number(2, "places", "that an edge may be off by", high=10)
    known: int = number(120, "places", "that always stand, looked at: fewer decide nothing", low=1)
    more: float = number(
        0.045, "share", "that disagrees at any other place than where it began", high=1.0
    )
    spoils: float = number(0.1, "share", "of a whole session: it is kept apart", high=1.0)


@dataclass(frozen=True, kw_only=True)
class HabitConfig(Settings):
    """How often and how long things stand."""

    bins: int = number(8, "bins", "of the hours of a day", low=1, high=96)
    prior: float = number(2.0, "looks", "that a place's share is drawn to the building's by")
    hourly: float = number(4.0, "looks", "that an hour's share is drawn to the place's by")
    least: float = number(0.01, "1", "no probability is nearer to 0 or 1", low=1e-6, high=0.5)


@dataclass(frozen=True, kw_only=True)
class ChangeConfig(Settings):
    """What counts as changed between two sessions."""

    stands: float = number(0.4, "share", "of the looks that found it: something stands", high=1.0)
    empty: float = number(0.1, "share", "of the looks that found it: nothing stands", high=1.0)
    rest: float = number(0.3, "ratio", "to the other session's share, at most: it went", high=1.0)
    faint: float = number(0.15, "share", "that something has where it is thin, as a leg", high=1.0)
    join_m: float = number(0.25, "m", "cells nearer than this are one object")
    slack_m: float = number(0.2, "m", "an edge that moved by less has not moved")
    leg_m: float = number(0.3, "m", "a smaller part may be a leg of a thing")
    thing_m: float = number(0.7, "m", "legs within this are of one thing")
    least: float = number(0.53, "confidence", "what is less sure is not listed", high=1.0)
    moved_m: float = number(1.0, "m", "farthest that a thing is followed to another place")
    alike: float = number(0.6, "ratio", "of the smaller to the larger size: may be the same thing")
    leaf_least_m: float = number(0.55, "m", "shortest leaf of a door")
    leaf_most_m: float = number(1.3, "m", "longest leaf of a door")
    leaf_thick: float = number(0.55, "share", "of its length: a thicker piece is no leaf")
    hinge_m: float = number(0.6, "m", "farthest that the ends of a leaf's two places lie apart")


@dataclass(frozen=True, kw_only=True)
class NewsConfig(Settings):
    """What of a scan the days before do not know."""

    outdated: float = number(0.05, "share", "of the returns: the map is outdated here", high=1.0)
    stands: float = number(0.5, "share", "of the looks, when last seen: something stood", high=1.0)
    empty: float = number(0.05, "share", "of the looks, around it too: nothing stood", high=1.0)
    slack: int = number(1, "places", "that an edge may be off by", high=10)
    beyond_m: float = number(0.3, "m", "that a beam must go past a place where something stood")
    range_m: float = number(8.0, "m", "farthest place that is asked", low=1.0, high=100.0)
    reach: int = number(4, "places", "to others that are of the same thing", high=50)
    news_s: float = number(2.0, "s", "after its first scan; then the map has learnt it", low=0.0)


@dataclass(frozen=True, kw_only=True)
class DaysConfig(Settings):
    """All of them."""

    evidence: EvidenceConfig = field(default=EvidenceConfig())
    search: SearchConfig = field(default=SearchConfig())
    agreement: AgreementConfig = field(default=AgreementConfig())
    habit: HabitConfig = field(default=HabitConfig())
    change: ChangeConfig = field(default=ChangeConfig())
    news: NewsConfig = field(default=NewsConfig())
