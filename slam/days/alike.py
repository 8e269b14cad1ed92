# SPDX-License-Identifier: Apache-2.0
"""Other places in the map of days where a session would fit as well: then it is not found yet.

What stood in the session is laid over what always stands, at every angle and place (correlation by
FFT). The best places that are not the one found are asked for their agreement with the days before.
A room that looks the same after half a turn has one.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import fft

from slam import se2
from slam.days.agreement import Past
from slam.days.config import AlikeConfig, DaysConfig
from slam.frames import Float

_PEAKS = 3  # places, the best of each angle, by hand: rooms of one plan side by side
_TURNS_RAD = np.radians(np.arange(-2.0, 2.01, 0.5))  # rad, of the refinement: one step_deg each way
_STEPS_M = np.arange(
    -0.2, 0.201, 0.05
)  # m, of the refinement along x and y: a coarse cell each way


class Alike:
    """Finds such places in one map."""

    def __init__(self, past: Past, config: AlikeConfig | None = None) -> None:
        self.config = config or DaysConfig().alike
        always, corner_m = past.always_stands()
        self._cell_m = 2.0 * past.cell_m
        self._corner_m = corner_m
        tall, wide = (2 * ((n + 1) // 2) for n in always.shape)
        padded = np.zeros((tall, wide), np.uint8)
        padded[: always.shape[0], : always.shape[1]] = always
        halved = padded.reshape(tall // 2, 2, wide // 2, 2).max(axis=(1, 3))
        self._stands = cv2.dilate(halved, np.ones((3, 3), np.uint8)).astype(np.float32)
        self._fine_m = past.cell_m
        far = cv2.distanceTransform(1 - always, cv2.DIST_L2, 5) * past.cell_m
        self._near = np.clip(1.0 - far / self.config.near_m, 0.0, 1.0).astype(np.float32)

    def others(self, points: Float, T_map_own: Float) -> list[Float]:
        """Poses (3,) that explain ``points`` (n, 2) m, in the session's frame, nearly as well as
        ``T_map_own``, the best first.
        """
        if not len(points):
            return []
        middle = points.mean(axis=0)
        off = points - middle
        reach = math.ceil(float(np.hypot(off[:, 0], off[:, 1]).max()) / self._cell_m) + 1
        shape = tuple(fft.next_fast_len(n + 2 * reach, real=True) for n in self._stands.shape)
        image = fft.rfft2(self._stands, shape)
        found: list[tuple[float, Float]] = []
        for turn in np.radians(np.arange(0.0, 360.0, self.config.step_deg)).tolist():
            for score, at in self._peaks(image, shape, _turned(off, turn), reach):
                x, y = at - _turned(middle[None], turn)[0]
                found.append((score, np.array([x, y, se2.wrap(turn)])))
        least = self.config.share * self._score(points, T_map_own)
        chosen: list[Float] = []
        for _, rough in sorted(found, key=lambda pair: -pair[0])[: self.config.asked]:
            if self._is_one_of(rough, [T_map_own, *chosen], middle):
                continue
            pose = self._refined(points, middle, rough)
            again = self._is_one_of(pose, [T_map_own, *chosen], middle)
            if not again and self._score(points, pose) >= least:
                chosen.append(pose)
        return chosen[: self.config.most]

    def _peaks(
        self,
        image: NDArray[np.complex64],
        shape: tuple[int, ...],
        off: Float,
        reach: int,
    ) -> list[tuple[float, Float]]:
        """Highest correlations at one angle: how many points, and where their middle lies, m."""
        at = np.round(off / self._cell_m).astype(np.int64) + reach
        template = np.zeros((2 * reach + 1, 2 * reach + 1), np.float32)
        template[at[:, 1], at[:, 0]] = 1.0
        product = fft.irfft2(image * np.conj(fft.rfft2(template, shape)), shape)
        # place (j, i) of the middle is at lag (j - reach, i - reach), which wraps round
        tall, wide = self._stands.shape
        lags = np.roll(product, (reach, reach), axis=(0, 1))[:tall, :wide]
        counts = np.rint(lags).astype(np.float32)  # of 0 and 1: whole numbers, on any processor
        best = cv2.dilate(counts, np.ones((5, 5), np.uint8))
        j, i = np.nonzero((counts == best) & (counts > 0.5 * max(float(counts.max()), 1.0)))
        order = _apart(np.stack([i, j], axis=1), np.argsort(-counts[j, i], kind="stable"))
        count = max(int(template.sum()), 1)
        middles = (np.stack([i, j], axis=1)[order] + 0.5) * self._cell_m + self._corner_m
        return [
            (float(counts[b, a]) / count, m)
            for b, a, m in zip(j[order], i[order], middles, strict=True)
        ]

    def _score(self, points: Float, pose: Float) -> float:
        """Mean nearness, in [0, 1], of the points to what always stands."""
        return float(self._nearness(se2.transform(pose, points)).mean())

    def _nearness(self, points_map: Float) -> NDArray[np.float32]:
        at = np.floor((points_map - self._corner_m) / self._fine_m).astype(np.int64)
        height, width = self._near.shape
        inside = (at >= 0).all(axis=-1) & (at < (width, height)).all(axis=-1)
        i, j = np.where(inside, at[..., 0], 0), np.where(inside, at[..., 1], 0)
        return np.where(inside, self._near[j, i], np.float32(0.0))

    def _refined(self, points: Float, middle: Float, pose: Float) -> Float:
        """The best pose within 2 degrees and one coarse cell."""
        dx, dy = np.meshgrid(_STEPS_M, _STEPS_M)
        steps = np.stack([dx.ravel(), dy.ravel()], axis=1)
        at = se2.transform(pose, middle[None])[0]
        best, found = -1.0, pose
        for turn in (pose[2] + _TURNS_RAD).tolist():
            turned = _turned(points - middle, turn) + at
            scores = self._nearness(turned[None] + steps[:, None]).mean(axis=1)
            k = int(np.argmax(scores))
            if scores[k] > best:
                best = float(scores[k])
                x, y = at + steps[k] - _turned(middle[None], turn)[0]
                found = np.array([x, y, se2.wrap(turn)])
        return found

    def _is_one_of(self, pose: Float, others: list[Float], middle: Float) -> bool:
        """Whether the session's middle would lie near that of another, turned by little."""
        at = se2.transform(pose, middle[None])[0]
        return any(
            math.dist(at, se2.transform(one, middle[None])[0]) < self.config.apart_m
            and abs(se2.wrap(float(pose[2] - one[2]))) < self.config.apart_rad
            for one in others
        )


def _apart(cells: NDArray[np.int64], order: NDArray[np.int64]) -> NDArray[np.int64]:
    """The first ``_PEAKS`` of an order of cells (n, 2) that are more than two cells apart."""
    chosen: list[int] = []
    for k in order.tolist():
        if all(np.abs(cells[k] - cells[c]).max() > 2 for c in chosen):
            chosen.append(k)
            if len(chosen) == _PEAKS:
                break
    return np.array(chosen, dtype=np.int64)


def _turned(points: Float, turn: float) -> Float:
    c, s = math.cos(turn), math.sin(turn)
    return np.stack([c * points[:, 0] - s * points[:, 1], s * points[:, 0] + c * points[:, 1]], 1)
