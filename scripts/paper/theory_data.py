# SPDX-License-Identifier: Apache-2.0
"""Measurements on the network that sections 3.1, 3.2 and 3.4 of the paper make claims about."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam.frames import Features, Float, Frame
from slam.frontend.observations import Observations, from_features, from_scan
from slam.shunting.config import ShuntingConfig
from slam.shunting.map.energy import energy
from slam.shunting.map.network import Network, lateral_mu
from slam.shunting.slam import ShuntingSlam
from slam.tracker.cells import SIDE, Look
from slam.tracker.matching.matcher import Matcher
from slam.tracker.rasterise import rasterise


def inputs_of(network: Network, shape: tuple[int, int], i0: int, j0: int) -> Float:
    """Dense I of the present impressions, neurons (i0 + column, j0 + row)."""
    cells, out = network.cells, np.zeros(shape)
    for row, column in np.argwhere(cells.directory >= 0).tolist():
        scratch = int(cells.scratch_of[cells.directory[row, column]])
        if scratch < 0:
            continue
        j = (row + int(cells.corner[1])) * SIDE - j0
        i = (column + int(cells.corner[0])) * SIDE - i0
        out[j : j + SIDE, i : i + SIDE] = cells.impression[scratch]
    return out


def lyapunov(
    slam: ShuntingSlam, seen: Observations, pose: Float, sweeps: int, step: float
) -> tuple[Float, Float]:
    """V before and after each sweep under one fixed observation, and the largest change of x.

    The network of ``slam`` is swept on; its poses are not touched.
    """
    network, config = slam.network, slam.config
    T_map_laser = se2.compose(pose, seen.T_robot_laser)
    values: list[float] = []
    changes: list[float] = []
    for k in range(sweeps + 1):
        rasterise(network, seen, pose)
        extent = network.extent()
        assert extent is not None
        i0, j0, i1, j1 = extent
        before = _dense(network, extent)
        given = inputs_of(network, (j1 - j0, i1 - i0), i0, j0)
        values.append(
            energy(
                before,
                given,
                decay=config.decay_per_s,
                threshold=config.threshold,
                mu=network.mu,
                reach=config.lateral_reach_cells,
            )
        )
        if k == sweeps:
            network.release()
            break
        network.integrate(seen.view, T_map_laser, step, write=True)
        changes.append(float(np.abs(_dense(network, extent) - before).max()))
    return np.array(values), np.array(changes)


def _dense(network: Network, extent: tuple[int, int, int, int]) -> Float:
    i0, j0, i1, j1 = extent
    c = network.cell
    x, _ = network.window((i0 + 0.5) * c, (j0 + 0.5) * c, (i1 - 0.5) * c, (j1 - 0.5) * c)
    return x.astype(np.float64)


@dataclass(eq=False)
class Scaling:
    """One row for each map size: m^2, neurons alive, neurons visited by an update, ms of an update
    and of a match (medians of process time)."""

    area: list[float] = field(default_factory=list)
    alive: list[int] = field(default_factory=list)
    visited: list[int] = field(default_factory=list)
    update_ms: list[float] = field(default_factory=list)
    match_ms: list[float] = field(default_factory=list)


PITCH_M = 20.0
EVERY_S = 0.2  # between inspirations


def scaling(frame: Frame, rooms: Sequence[int], repeats: int = 15) -> Scaling:
    """The same scan in maps that hold ever more copies of what it shows, ``PITCH_M`` apart."""
    config = ShuntingConfig(range_m=9.0)
    assert frame.scan is not None
    seen = from_scan(frame.scan, np.zeros(3), config)
    matcher, out = Matcher(config), Scaling()
    network, made = Network(config), 0
    for count in rooms:
        for k in range(made, count):  # nearest first, so that the first one is the origin
            _look(network, seen, _place(k))
        made = count
        update, match, visited = [], [], 0
        for _ in range(repeats):
            start = time.process_time()
            visited = _look(network, seen, np.zeros(3)).visited
            middle = time.process_time()
            matcher.climb(network, seen, np.array([0.02, 0.01, 0.01]), np.zeros(3), np.eye(3))
            update.append(middle - start)
            match.append(time.process_time() - middle)
        out.area.append(count * PITCH_M**2)
        out.alive.append(alive(network))
        out.visited.append(visited)
        out.update_ms.append(1e3 * float(np.median(update)))
        out.match_ms.append(1e3 * float(np.median(match)))
    return out


def _place(k: int) -> Float:
    """Cell k of a square spiral."""
    x = y = 0
    dx, dy, leg, left, turns = 1, 0, 1, 1, 0
    for _ in range(k):
        x, y, left = x + dx, y + dy, left - 1
        if left == 0:
            dx, dy, turns = -dy, dx, turns + 1
            leg += turns % 2 == 0
            left = leg
    return np.array([x * PITCH_M, y * PITCH_M, 0.0])


def _look(network: Network, seen: Observations, pose: Float) -> Look:
    rasterise(network, seen, pose)
    T_map_laser = se2.compose(pose, seen.T_robot_laser)
    return network.integrate(seen.view, T_map_laser, EVERY_S, write=True)


def alive(network: Network) -> int:
    """Neurons that are not silent."""
    slots = network.cells.directory[network.cells.directory >= 0]
    return int(((network.cells.x[slots] > 0.0) | (network.cells.y[slots] > 0.0)).sum())


def growth(slam: ShuntingSlam, frames: Sequence[Frame], every: int) -> tuple[Float, Float]:
    """Area explored (m^2, in squares of 1 m) and neurons alive, at every so many frames."""
    explored: set[tuple[int, int]] = set()
    area, neurons = [], []
    for k, frame in enumerate(frames):
        pose = slam.update(frame.without_truth()).T_map_robot
        if k % every:
            continue
        explored.update(map(tuple, np.floor(_free(frame, pose)).astype(int).tolist()))
        area.append(float(len(explored)))
        neurons.append(float(alive(slam.network)))
    return np.array(area), np.array(neurons)


def _free(frame: Frame, pose: Float) -> Float:
    """(n, 2) places seen: along the beams, or the half disc of a sensor of features."""
    if frame.scan is not None:
        ranges = np.where(frame.scan.valid, frame.scan.ranges, 0.0)
        angles, T = frame.scan.spec.angles, se2.compose(pose, frame.scan.spec.T_robot_laser)
    else:
        ranges, angles, T = np.full(91, 12.0), np.linspace(-1.57, 1.57, 91), pose
    share = np.arange(0.0, 1.0, 0.04)[:, None]
    r = share * ranges[None, :]
    points = np.stack([r * np.cos(angles), r * np.sin(angles)], axis=-1).reshape(-1, 2)
    return se2.transform(T, points)


def bell(looks: Sequence[int]) -> tuple[Float, dict[int, Float]]:
    """Cross-sections of the activity after so many inspirations at one place, not on a neuron.

    Returns the offsets from that place (m) and the activities along the row of neurons.
    """
    config = ShuntingConfig.paper(cell_m=0.05)
    network, at = Network(config), np.array([2.013, 0.021])
    features = Features(
        stamp_ns=0, points_robot=at[None], covariances=np.array([[[0.01, 0.0], [0.0, 0.01]]])
    )
    seen = from_features(features, config)
    out: dict[int, Float] = {}
    for k in range(1, max(looks) + 1):
        rasterise(network, seen, np.zeros(3))
        network.integrate(seen.view, np.zeros(3), EVERY_S, write=True)
        if k in looks:
            x, _ = network.window(1.0, 0.0, 3.0, 0.05)
            out[k] = x[0].astype(np.float64)
    width = len(next(iter(out.values())))
    first = math.ceil(1.0 / network.cell - 0.5 - 1e-6)
    offsets = (first + np.arange(width) + 0.5) * network.cell - at[0]
    return offsets, out


def library_sweeps(
    seen: Observations, config: ShuntingConfig, sweeps: int, step: float
) -> tuple[list[Float], Float]:
    """Activities of a new network before and after each sweep of ``Network.integrate`` under one
    fixed observation, and the input I that this was (all dense, row 0 lowest)."""
    network, pose = Network(config), np.zeros(3)
    rasterise(network, seen, pose)
    extent = network.extent()
    assert extent is not None
    i0, j0, i1, j1 = extent
    given = inputs_of(network, (j1 - j0, i1 - i0), i0, j0)
    out = [_dense(network, extent)]
    for _ in range(sweeps):
        rasterise(network, seen, pose)
        network.integrate(seen.view, seen.T_robot_laser, step, write=True)
        out.append(_dense(network, extent))
    return out, given


def colour_sweeps(inputs: Float, config: ShuntingConfig, sweeps: int, step: float) -> list[Float]:
    """The same in four colours: neurons two apart are no neighbours, so that all of one colour can
    be updated at once. Neurons without input stay silent, as in the library."""
    mu = lateral_mu(config.lateral_sum, config.lateral_reach_cells)
    x = np.zeros_like(inputs)
    out = [x.copy()]
    for _ in range(sweeps):
        for colour in range(4):
            at = (slice(colour // 2, None, 2), slice(colour % 2, None, 2))
            x[at] = _stepped(x, inputs, at, mu, config, step)
        out.append(x.copy())
    return out


def _stepped(
    x: Float, inputs: Float, at: Any, mu: float, config: ShuntingConfig, step: float
) -> NDArray[np.float64]:
    """Eq. (8), implicit, of the neurons ``at`` (eight neighbours)."""
    d = np.pad(np.maximum(x - config.threshold, 0.0), 1)
    rows, columns = x.shape
    total = np.zeros_like(x[at])
    for dj in (-1, 0, 1):
        for di in (-1, 0, 1):
            if di or dj:
                moved = d[1 + dj : 1 + dj + rows, 1 + di : 1 + di + columns]
                total += mu / math.hypot(di, dj) * moved[at]
    E = inputs[at] + total
    out = (x[at] + step * E) / (1.0 + step * (config.decay_per_s + E))
    falls = config.threshold * (config.decay_per_s + E) > E
    silent = (inputs[at] == 0.0) | ((out < config.threshold) & falls)
    return np.where(silent, 0.0, out)
