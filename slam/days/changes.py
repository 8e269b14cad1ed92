# SPDX-License-Identifier: Apache-2.0
"""What changed between two sessions: things that appeared, are gone or moved, doors that turned.

Only places that both sessions saw can tell. Places where something stood in one and (nearly)
nothing in the other are joined to objects; one that is gone and one of about its size that appeared
nearby are taken for the same thing, moved. Two thin ones that share an end are a door, before and
after.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from slam.arrays import Bools, Float, Float32, Ints
from slam.days.evidence import Snapshot
from slam.days.history import History, dense

# What counts as changed between two sessions; all set by hand.
STANDS = 0.4  # share of the looks that found it: something stands
EMPTY = 0.1  # share of the looks that found it: nothing stands
REST = 0.3  # ratio to the other session's share, at most: it went
FAINT = 0.15  # share that something has where it is thin, as a leg
JOIN_M = 0.25  # m; cells nearer than this are one object
SLACK_M = 0.2  # m; an edge that moved by less has not moved
LEG_M = 0.3  # m; a smaller part may be a leg of a thing
THING_M = 0.7  # m; legs within this are of one thing
LEAST = 0.53  # confidence; what is less sure is not listed
MOVED_M = 1.0  # m, farthest that a thing is followed to another place
ALIKE = 0.6  # ratio of the smaller to the larger size: may be the same thing
LEAF_LEAST_M, LEAF_MOST_M = 0.55, 1.3  # m, shortest and longest leaf of a door
LEAF_THICK = 0.55  # share of its length: a thicker piece is no leaf
HINGE_M = 0.6  # m, farthest that the ends of a leaf's two places lie apart

KINDS = ("appeared", "gone", "moved", "door")


@dataclass(frozen=True, kw_only=True)
class Change:
    """One thing that is otherwise than in the session before.

    kind        one of ``KINDS``
    at          (x, y) m in the map: where it stands, or stood if it is gone; a door's hinge
    before      (x, y) m where a moved thing stood; None for the others
    size_m      longest side of what was seen of it
    angle_deg   by which a door turned, counter-clockwise; 0 for the others
    places      middles (x, y) m of what was seen to differ: of a moved thing and of a door's leaf
                before and after, of the others one
    confidence  in [0, 1]: 1 - exp(-sum over its places of how clear both sessions are about each),
                less where one of the sessions saw only part of what is around
    """

    kind: str
    at: tuple[float, float]
    size_m: float
    confidence: float
    before: tuple[float, float] | None = None
    angle_deg: float = 0.0
    places: tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Piece:
    """Places that changed together: ``points`` (n, 2) m, ``ends`` (2, 2) of its longest line."""

    points: Float
    confidence: float
    centre: Float
    ends: Float
    size_m: float
    thick_m: float


@dataclass(frozen=True, kw_only=True, eq=False)
class _Part:
    """Neighbouring places that changed: ``points`` (n, 2) m, ``clear`` (n,) by how much."""

    points: Float
    clear: Float

    @property
    def middle(self) -> Float:
        return np.asarray(self.points.mean(axis=0))


def between(before: Snapshot, after: Snapshot, cell_m: float) -> list[Change]:
    """The changes from one session to a later one, the surest first."""
    if not len(before.cells) or not len(after.cells):
        return []
    cells, shares = History(cell_m=cell_m, sessions=(before, after)).table()
    low, (old, new) = dense(cells, shares)
    gone = _pieces(old, new, low, cell_m)
    come = _pieces(new, old, low, cell_m)
    found = [*_doors(gone, come), *_moved(gone, come)]
    for kind, rest in (("gone", gone), ("appeared", come)):
        found += [
            Change(
                kind=kind,
                at=_point(p.centre),
                size_m=p.size_m,
                confidence=p.confidence,
                places=(_point(p.centre),),
            )
            for p in rest
        ]
    return sorted(found, key=lambda c: (-c.confidence, c.at))


def _pieces(
    there: Float32,
    other: Float32,
    low: Ints,
    cell_m: float,
) -> list[_Piece]:
    """What stands in one image where the other is empty, joined to pieces."""
    changed = _changed(there, other, cell_m).astype(np.uint8)
    joined = _grown(changed > 0, 0.5 * JOIN_M / cell_m).astype(np.uint8)
    known = _known_around(there, other, SLACK_M / cell_m)
    count, labels = cv2.connectedComponents(joined, connectivity=8)
    parts = []
    for label in range(1, count):
        j, i = np.nonzero((labels == label) & (changed > 0))
        points: Float = (np.stack([i, j], axis=1) + low).astype(np.float64) * cell_m + 0.5 * cell_m
        clear = (there[j, i] - other[j, i]) * known[j, i]
        parts.append(_Part(points=points, clear=clear.astype(np.float64)))
    pieces = [_piece(part, cell_m) for part in _legs_joined(parts, cell_m)]
    return [piece for piece in pieces if piece.confidence >= LEAST]


def _changed(there: Float32, other: Float32, cell_m: float) -> Bools:
    """Where something stands in one image, and in the other nothing does.

    Beams pass beside what is thin, as the legs of a chair: it has a small share. That counts where
    the other session saw nothing at all around.
    """
    slack = SLACK_M / cell_m
    with np.errstate(invalid="ignore"):
        went = other <= np.maximum(EMPTY, REST * there)
        solid = (there >= STANDS) & went & ~_grown(other >= STANDS, slack)
        thin = (there >= FAINT) & ~np.isnan(other) & ~_grown(other > EMPTY, slack)
    return np.asarray(solid | thin)


def _known_around(one: Float32, other: Float32, cells: float) -> Float32:
    """Share of the places around each that both saw: at the edge of what was seen, edges move."""
    side = 2 * math.floor(cells + 1e-9) + 1
    both = (~np.isnan(one) & ~np.isnan(other)).astype(np.float32)
    return np.asarray(cv2.blur(both, (side, side), borderType=cv2.BORDER_CONSTANT))


def _legs_joined(parts: list[_Part], cell_m: float) -> list[_Part]:
    """Small parts, as the legs of a chair are, joined while they fit into one thing."""
    small = [p for p in parts if _extent(p.points, cell_m) <= LEG_M]
    joined = [p for p in parts if _extent(p.points, cell_m) > LEG_M]
    while small:
        one = small.pop(0)
        nearest = sorted(small, key=lambda p: float(np.linalg.norm(p.middle - one.middle)))
        for other in nearest:
            both = np.concatenate([one.points, other.points])
            if _extent(both, cell_m) <= THING_M:
                one = _Part(points=both, clear=np.concatenate([one.clear, other.clear]))
                small.remove(other)
        joined.append(one)
    return joined


def _extent(points: Float, cell_m: float) -> float:
    """Longest side of the box around, along the axes, m."""
    return float((points.max(axis=0) - points.min(axis=0)).max()) + cell_m


def _grown(image: Bools, cells: float) -> Bools:
    n = max(0, math.floor(cells + 1e-9))
    y, x = np.mgrid[-n : n + 1, -n : n + 1]
    disc = (x * x + y * y <= cells * cells + 1e-9).astype(np.uint8)
    return np.asarray(cv2.dilate(image.astype(np.uint8), disc) > 0)


def _piece(part: _Part, cell_m: float) -> _Piece:
    points = part.points
    confidence = 1.0 - math.exp(-max(float(part.clear.sum()), 0.0))
    centre = points.mean(axis=0)
    off = points - centre
    _, _, axes = np.linalg.svd(off, full_matrices=False) if len(off) > 1 else (0, 0, np.eye(2))
    along = off @ axes[0]
    across = off @ np.array([-axes[0][1], axes[0][0]])
    middle = centre + 0.5 * (along.min() + along.max()) * axes[0]
    half = 0.5 * (along.max() - along.min() + cell_m)
    return _Piece(
        points=points,
        confidence=confidence,
        centre=middle,
        ends=np.array([middle - half * axes[0], middle + half * axes[0]]),
        size_m=float(2.0 * half),
        thick_m=float(across.max() - across.min() + cell_m),
    )


def _doors(gone: list[_Piece], come: list[_Piece]) -> list[Change]:
    """Thin pieces of a leaf's length that share an end; they are taken off both lists."""
    found = []
    for old in list(gone):
        for new in list(come):
            hinge = _hinge(old, new)
            if hinge is None:
                continue
            (x, y), turned, length = hinge
            found.append(
                Change(
                    kind="door",
                    at=(x, y),
                    size_m=length,
                    confidence=min(old.confidence, new.confidence),
                    angle_deg=math.degrees(turned),
                    places=(_point(old.centre), _point(new.centre)),
                )
            )
            gone.remove(old)
            come.remove(new)
            break
    return found


def _hinge(old: _Piece, new: _Piece) -> tuple[tuple[float, float], float, float] | None:
    """Where two leaves' lines meet, the angle between them, and the leaf's length, m.

    None where they are no door. Next to the hinge the two overlap, so neither piece reaches it.
    """
    if any(p.thick_m > LEAF_THICK * p.size_m for p in (old, new)):
        return None
    apart = np.linalg.norm(old.ends[:, None] - new.ends[None], axis=2)
    a, b = np.unravel_index(int(np.argmin(apart)), apart.shape)
    if apart[a, b] > HINGE_M:
        return None
    hinge = _meeting(old.ends[[a, 1 - a]], new.ends[[b, 1 - b]], HINGE_M)
    first, second = old.ends[1 - a] - hinge, new.ends[1 - b] - hinge
    length = 0.5 * float(np.linalg.norm(first) + np.linalg.norm(second))
    if not LEAF_LEAST_M <= length <= LEAF_MOST_M:
        return None
    cross = float(first[0] * second[1] - first[1] * second[0])
    return _point(hinge), math.atan2(cross, float(first @ second)), length


def _meeting(old: Float, new: Float, near_m: float) -> Float:
    """Where the lines of two pieces (near end, far end) meet, if that is near; else between."""
    along, other = old[0] - old[1], new[0] - new[1]
    cross = float(along[0] * other[1] - along[1] * other[0])
    between_ends = np.asarray(0.5 * (old[0] + new[0]))
    if abs(cross) < 1e-6:
        return between_ends
    off = new[1] - old[1]
    met = old[1] + along * float(off[0] * other[1] - off[1] * other[0]) / cross
    far = max(np.linalg.norm(met - old[0]), np.linalg.norm(met - new[0]))
    return np.asarray(met) if far <= near_m else between_ends


def _moved(gone: list[_Piece], come: list[_Piece]) -> list[Change]:
    """Pairs of about one size, the nearest first; they are taken off both lists."""
    pairs = sorted(
        (float(np.linalg.norm(old.centre - new.centre)), a, b)
        for a, old in enumerate(gone)
        for b, new in enumerate(come)
        if min(old.size_m, new.size_m) >= ALIKE * max(old.size_m, new.size_m)
    )
    found, left, right = [], dict(enumerate(gone)), dict(enumerate(come))
    for apart, a, b in pairs:
        if apart > MOVED_M or a not in left or b not in right:
            continue
        old, new = left.pop(a), right.pop(b)
        found.append(
            Change(
                kind="moved",
                at=_point(new.centre),
                before=_point(old.centre),
                size_m=max(old.size_m, new.size_m),
                confidence=min(old.confidence, new.confidence),
                places=(_point(old.centre), _point(new.centre)),
            )
        )
    gone[:], come[:] = list(left.values()), list(right.values())
    return found


def _point(xy: Float) -> tuple[float, float]:
    return float(xy[0]), float(xy[1])
