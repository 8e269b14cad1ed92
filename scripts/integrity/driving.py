# SPDX-License-Identifier: Apache-2.0
"""How the robot drives through a building of the plane, and what its wheels say of it."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order

from scripts.integrity.layouts import Layout
from slam import se2
from slam._jit import njit
from slam.frames import Float

SPEED_MPS = (0.42, 0.55)
TURN_RADPS, SPIN_RADPS2, RISE_MPS2 = 0.9, 2.5, 0.6
CORNER_M, STOP_M = 0.3, 0.08  # from a node: it curves round it from here; it stops there and turns
STOPS = 0.3  # share of the nodes at which it stops and turns in place
FIFTH, SLIGHT = 0.2, 0.02  # of a step, noise of odometry (1 sigma)
TURN_PER_M = 0.02  # rad of heading noise a metre driven, of every model but "good"
BIASED = (0.98, 1.04)  # of the "biased" model: gain of the way and of the heading


def tour(layout: Layout, count: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """(count,) nodes: from a drawn one by the fewest edges to one visited least, and on."""
    n = len(layout.nodes)
    start, end = np.stack([layout.edges, layout.edges[:, ::-1]], axis=1).reshape(-1, 2).T
    order = np.argsort(start, kind="stable")
    first = np.searchsorted(start[order], np.arange(n + 1))
    graph = csr_array((np.ones(len(end)), end[order], first), shape=(n, n))
    visits, out = np.zeros(n), [int(rng.integers(n))]
    while len(out) < count:
        visits[out[-1]] += 1.0
        costs = visits + rng.uniform(0.0, 0.9, n)
        costs[out[-1]] = np.inf
        goal = int(np.argmin(costs))
        towards = breadth_first_order(graph, goal)[1]
        while out[-1] != goal:
            out.append(int(towards[out[-1]]))
            visits[out[-1]] += 1.0
    return np.array(out[:count], dtype=np.int64)


@njit
def _drive(nodes: Float, stops: Float, speed: float, dt: float, path: Float) -> None:
    """Fill ``path`` (n, 3): a unicycle from node to node, ``dt`` s between poses."""
    x, y = nodes[0, 0], nodes[0, 1]
    heading = math.atan2(nodes[1, 1] - y, nodes[1, 0] - x)
    v, w, k = 0.0, 0.0, 1
    for n in range(path.shape[0]):
        path[n, 0], path[n, 1], path[n, 2] = x, y, heading
        dx, dy = nodes[k, 0] - x, nodes[k, 1] - y
        away = math.sqrt(dx * dx + dy * dy)
        if away < (STOP_M if stops[k] > 0.5 else CORNER_M) and k < nodes.shape[0] - 1:
            k += 1
            dx, dy = nodes[k, 0] - x, nodes[k, 1] - y
            away = math.sqrt(dx * dx + dy * dy)
        off = math.atan2(dy, dx) - heading
        off = math.atan2(math.sin(off), math.cos(off))
        wanted = min(max(2.5 * off, -TURN_RADPS), TURN_RADPS)
        ahead = max(0.0, math.cos(min(1.5 * abs(off), 1.5708)))
        slow = min(1.0, 0.15 + away) if stops[k] > 0.5 else 1.0
        goal = speed * ahead * slow
        v += min(max(goal - v, -2.0 * RISE_MPS2 * dt), RISE_MPS2 * dt)
        w += min(max(wanted - w, -SPIN_RADPS2 * dt), SPIN_RADPS2 * dt)
        x += v * math.cos(heading + 0.5 * w * dt) * dt
        y += v * math.sin(heading + 0.5 * w * dt) * dt
        heading += w * dt


def driven(layout: Layout, seconds: float, dt: float, rng: np.random.Generator) -> Float:
    """(n, 3) true poses, ``dt`` s apart; m and rad, the heading unwrapped."""
    nodes = layout.nodes[tour(layout, int(seconds) + 20, rng)]
    stops = (rng.random(len(nodes)) < STOPS).astype(np.float64)
    path = np.zeros((round(seconds / dt), 3))
    _drive(nodes, stops, float(rng.uniform(*SPEED_MPS)), dt, path)
    return path


def odometry(
    path: Float, model: str, rng: np.random.Generator
) -> tuple[list[Float], list[Float | None]]:
    """What wheels make of true poses (n, 3): poses of odometry, and covariances that are stated.

    Of each step dx, dy, dtheta in the robot's frame, with d its length: x and y get noise of a
    fifth of d, the heading a fifth of dtheta and 0.02 rad a metre (1 sigma each, independent).
    "fifth" states no covariance, "stated" the true one; "biased" drives 2 % short and turns 4 % far
    beyond that; "good" has a fiftieth in the place of a fifth.
    """
    share = SLIGHT if model == "good" else FIFTH
    along, turned = BIASED if model == "biased" else (1.0, 1.0)
    noise = rng.standard_normal((len(path), 3))
    poses, stated = [np.zeros(3)], [np.zeros((3, 3)) if model == "stated" else None]
    for k in range(1, len(path)):
        dx, dy, turn = se2.between(path[k - 1], path[k]).tolist()
        d = math.sqrt(dx * dx + dy * dy)
        per_m = 0.1 * TURN_PER_M if model == "good" else TURN_PER_M
        sigma = np.array([share * d, share * d, math.hypot(share * turn, per_m * d)])
        step = np.array([along * dx, along * dy, turned * turn]) + sigma * noise[k]
        poses.append(se2.compose(poses[-1], step))
        stated.append(np.diag(sigma * sigma) if model == "stated" else None)
    return poses, stated
