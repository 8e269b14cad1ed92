# SPDX-License-Identifier: Apache-2.0
"""A scanner's beams cast on the geoms of one model, each at its own time."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.core.packed import packed
from sim.sensors.lidar import columns as col
from sim.sensors.lidar import raycast, windows
from sim.sensors.lidar.candidates import candidates
from sim.sensors.lidar.scanner import Spot
from slam.frames import Float

Hits = tuple[Float, NDArray[np.int64], Float]
# (m, 12) poses of what can move; (3,) x, y, yaw of the laser; (bodies, 7) the bodies' places, NaN
# for those that moved or are not known.
Noted = tuple[Float, Float, Float]


@dataclass(frozen=True, kw_only=True, eq=False)
class FanPlan:
    """The beams of a scan, fan by fan.

    beams  (m,) number of each beam
    ends   (fans + 1,) where each fan's rows begin, and the last one's end
    rows   (m, 5) of each beam as planned; angles ascend by even steps within a fan
    """

    beams: NDArray[np.int64]
    ends: NDArray[np.int64]
    rows: Float

    @classmethod
    def of(
        cls, fans: Sequence[tuple[NDArray[np.int64], Float, NDArray[np.int64], Float]]
    ) -> "FanPlan":
        """From (beams, angles, slots, parts) of each fan."""
        beams, angles, slots, parts = (np.concatenate(column) for column in zip(*fans, strict=True))
        cos, sin = ([f(a) for a in angles.tolist()] for f in (math.cos, math.sin))
        return cls(
            beams=beams.astype(np.int64),
            ends=np.cumsum([0, *(fan[0].size for fan in fans)]).astype(np.int64),
            rows=np.ascontiguousarray(np.column_stack((angles, cos, sin, slots, parts))),
        )


class Raycaster:
    """Casts scans, fans of beams, on the geoms of one model.

    height     m, of the scan plane
    robot      name of the scanner's own body; it and its children are not seen
    spot       the rays of each beam
    range_max  m, bounds how far the spot spreads up and down
    slots      the most notes of a scan
    panes      optional (ngeom,) True for what beams may pass: cast apart, as a second layer
    site       id of the laser's site, whose poses are then noted too

    Raises ``InvalidValueError`` for a mesh, height field or SDF that could meet the scan plane:
    the formulas cover primitives only.

    Attributes: ``ids`` (n,) geom ids of the candidates; ``lasers`` (slots, 3) x, y, yaw of the
    laser at each ``note`` of the scan; after ``cast``, ``hits`` (ranges m, candidates, |cos| of
    the incidence), each (layers, beams, rays): inf, -1 and NaN for a miss, and ``fan`` (m, 7) the
    beams in the world; after ``start``, ``noted``, a packed ``windows.Noted``.
    """

    def __init__(  # noqa: PLR0913 (settings by keyword)
        self,
        model: mujoco.MjModel,
        *,
        height: float,
        robot: str | None = "robot/base",
        spot: Spot | None = None,
        range_max: float = 80.0,
        slots: int = 12,
        panes: NDArray[np.bool_] | None = None,
        site: int = -1,
    ) -> None:
        self.spot = Spot() if spot is None else spot
        self.height = height
        passed = np.zeros(model.ngeom, dtype=np.bool_) if panes is None else panes
        reach = self.spot.aperture + self.spot.divergence * range_max
        self.ids, self.table = candidates(model, height, reach, robot, passed)
        self.layers = 2 if bool(passed[self.ids].any()) else 1
        n = self.ids.size
        self._rays = self.spot.rays()
        self._optics = (height, self.spot.aperture, self.spot.divergence)
        self.poses = np.zeros((slots, n, col.N_POSE))
        self.bounds = np.zeros((n, col.N_BOUND))
        self.lasers = np.zeros((slots, 3))
        bodies, first, count = np.unique(
            model.geom_bodyid[self.ids], return_index=True, return_counts=True
        )  # ids ascend, and so do their bodies
        moves = np.full(bodies.size, col.MOVES)
        self._all = np.column_stack((bodies, first, first + count, moves)).astype(np.int64)
        self._runs = self._all[model.body_weldid[bodies] != 0]
        self._movable = np.concatenate(
            [np.arange(a, b) for _, a, b, _ in self._runs.tolist()] or [np.arange(0)]
        )
        self._site = site
        self._filled = np.zeros(1, dtype=np.int64)
        self._seen: mujoco.MjData | None = None
        self._plan: FanPlan | None = None

    @property
    def rays_per_beam(self) -> int:
        """Number of rays cast for each beam."""
        return len(self.spot.offsets)

    def start(self, data: mujoco.MjData, before: Noted | None = None) -> None:
        """Forget the last scan, and note where everything is; needs fresh kinematics.

        before  what ``last_notes`` gave of the step before, to be the first note instead
        """
        self._filled[0] = 0
        if data is not self._seen:
            self._seen = data
            where = (
                data.xpos, data.xquat, data.geom_xpos, data.geom_xmat, data.site_xpos,
                data.site_xmat, self._site, self.poses, self.lasers, self._filled,
            )  # fmt: skip
            self._all[:, col.RUN_STATE] = self._runs[:, col.RUN_STATE] = col.MOVES
            none = np.zeros((len(self._all), 7))
            windows.note(packed(windows.Noted(self.ids, self._all, none, *where)))
            windows.enclose(self.table, self._all, self.poses, 1, self.bounds)
            self._places = np.zeros((len(self._runs), 7))
            self.noted = packed(windows.Noted(self.ids, self._runs, self._places, *where))
            self._filled[0] = 0
        if before is not None:
            self.poses[0, self._movable], self.lasers[0], self._places[:] = before
            self._runs[:, col.RUN_STATE] = col.PLACED
            self._filled[0] = 1
        self.note()

    def last_notes(self) -> tuple[Noted, Noted]:
        """The two last notes of the scan, the older one first."""
        last = int(self._filled[0]) - 1
        moved = self._runs[:, col.RUN_STATE] == col.MOVES
        places = np.where(moved[:, np.newaxis], np.nan, self._places)
        older, newer = (
            (self._poses_at(slot), self.lasers[slot].copy(), places) for slot in (last - 1, last)
        )
        return older, newer

    def _poses_at(self, slot: int) -> Float:
        """(m, 12) of what can move."""
        moved = np.repeat(
            self._runs[:, col.RUN_STATE] == col.MOVES,
            self._runs[:, col.RUN_END] - self._runs[:, col.RUN_FIRST],
        )
        poses: Float = self.poses[0, self._movable]
        poses[moved] = self.poses[slot, self._movable[moved]]
        return poses

    def settle(self, expected: Noted) -> bool:
        """What was moved by hand since the first of two notes is taken to have stood there then.

        expected  what the second note would be otherwise
        Returns whether the laser is where it was expected.
        """
        now = self._poses_at(1)
        moved = (now != expected[0]).any(axis=1)
        self.poses[0, self._movable[moved]] = now[moved]
        stands = bool(np.array_equal(self.lasers[1], expected[1]))
        if not stands:
            self.lasers[0] = self.lasers[1]
        return stands

    @property
    def movable_ids(self) -> NDArray[np.int64]:
        """(m,) ids of the geoms that ``last_notes`` is of."""
        ids: NDArray[np.int64] = self.ids[self._movable]
        return ids

    def note(self) -> None:
        """Note where everything is now, in the next slot."""
        windows.note(self.noted)

    def cast(self, plan: FanPlan) -> None:
        """Cast the beams of the scan that has just ended, into ``hits``."""
        if plan is not self._plan:
            self._prepare(plan)
        raycast.sweep(
            self.table, self._runs, self.poses, self.lasers, int(self._filled[0]), self.bounds,
            plan.rows, plan.ends, plan.beams, self._rays, self._optics, self._work, self.hits,
        )  # fmt: skip

    def _prepare(self, plan: FanPlan) -> None:
        """Room for the beams of a plan."""
        self._plan, m, n = plan, plan.beams.size, 3 * self.ids.size
        shape = (self.layers, m, self.rays_per_beam)
        self.hits = (np.zeros(shape), np.zeros(shape, dtype=np.int64), np.zeros(shape))
        self.fan = np.zeros((m, col.N_BEAM))
        self._work = (
            self.fan, np.zeros((plan.ends.size - 1, col.N_FAN)), np.zeros(shape[:2]),
            np.zeros((n, col.N_WINDOW)), np.zeros(n, dtype=np.int64),
            np.zeros(n + windows.BUCKETS + 1, dtype=np.int64),
        )  # fmt: skip

    def mirror(self, polished: NDArray[np.bool_], out: Hits) -> None:
        """Follow the middle rays off panes and off ``polished`` candidates.

        out  (all beams,) each: length of the way m, inf for none; candidate; |cos| there
        """
        assert self._plan is not None
        raycast.reflect(
            self.table, polished, self.poses, self.bounds, self.fan, self._plan.beams,
            self.height, self.hits, out,
        )  # fmt: skip
