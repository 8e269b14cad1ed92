# SPDX-License-Identifier: Apache-2.0
"""One short episode, live and recorded."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from sim.moments import Moment, toured
from sim.recording.episode import record
from sim.recording.recipe import Recipe
from sim.simulation import Simulation

RECIPE = Recipe(scene="office", seed=3, dynamism=1.0, seconds=2.0)


@dataclass
class Recorded:
    """``moments`` as simulated; ``path`` of the recording of another, equal simulation."""

    recipe: Recipe
    simulation: Simulation
    moments: list[Moment]
    path: Path


@pytest.fixture(scope="session")
def recorded(tmp_path_factory) -> Recorded:
    folder = tmp_path_factory.mktemp("dataset")
    record(RECIPE, folder)
    simulation = Simulation(**RECIPE.simulation())
    moments = list(toured(simulation, RECIPE.seconds))
    return Recorded(RECIPE, simulation, moments, folder / RECIPE.name)
