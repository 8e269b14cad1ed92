# SPDX-License-Identifier: Apache-2.0
"""Hands let go: nothing pushes who has just put something down."""

from __future__ import annotations

import numpy as np

from sim.actors.holding import DROPPED, QB, VA
from sim.simulation import Simulation, tour


def test_who_has_put_a_chair_down_is_pushed_by_nothing():
    simulation = Simulation(
        "arena", seed=3, motion=0.5, change=0.0, crowd="cleaners:2", n_chairs=8, n_people=0
    )
    world = simulation.world
    held = world.people.table.held.at
    had, empty = np.zeros(len(held), dtype=bool), 0
    for _ in tour(simulation, 20.0):
        for k in np.flatnonzero(had & (held[:, QB] < 0) & (held[:, DROPPED] < 0)):
            empty += 1
            first = held[k, VA]
            assert (world.data.qfrc_applied[first : first + 3] == 0.0).all()
        had |= held[:, QB] >= 0
    assert empty > 20
