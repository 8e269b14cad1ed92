# SPDX-License-Identifier: Apache-2.0
"""SLAMs on a simulated tour: builds the simulation, and the panes that only a simulation has."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

from scripts.console import note
from scripts.session import Outputs, primary_of, run_session, systems_named
from scripts.show import Show
from sim import gl
from sim.pictures import CameraPicture, MapPicture
from sim.simulation import Simulation, n_frames, tour
from slam.frames import Stream
from slam.replay import Replay

CAMERA_SIZE = (480, 300)
WORLD_SIZE = (480, 312)


def on_scene(names: list[str], settings: Mapping[str, Any], outputs: Outputs) -> dict[str, Any]:
    """Run SLAMs on a tour of a scene.

    settings  scene, seconds, dynamism, seed; further keys go to ``Simulation``
    """
    replay = Replay.of(systems_named(names))
    simulated = {k: v for k, v in settings.items() if k != "seconds"}
    simulation = Simulation(**simulated)
    seconds = float(settings["seconds"])
    stream = Stream(
        metadata=simulation.metadata(),
        frames=lambda: tour(simulation, seconds),
        length=n_frames(seconds, simulation.scan_period_s),
    )
    show = Show(
        replay=replay,
        primary=primary_of(replay),
        title=f"{settings['scene']} · dynamism {settings['dynamism']} · seed {settings['seed']}",
        duration_s=seconds,
        bounds=simulation.world.scene.bounds,
    )
    made_with = {"odometry": simulation.odometry_preset, **simulation.metadata().extra}
    recipe = {"slams": list(replay.tracks), **settings, "simulation": made_with}
    with ExitStack() as stack:
        if outputs.film:
            _add_panes(show, simulation, stack)
        return run_session(stream, replay, show, replace(outputs, settings=recipe))


def _add_panes(show: Show, simulation: Simulation, stack: ExitStack) -> None:
    plan = MapPicture(simulation, WORLD_SIZE)
    show.world = lambda frame, size: plan(simulation)
    found = gl.find()
    if found.backend is None:
        note(f"the film has no 3D panel: {found.reason}")
        return
    camera = stack.enter_context(CameraPicture(simulation, CAMERA_SIZE, "follow", shadows=False))
    show.camera = lambda frame, size: camera(simulation)
