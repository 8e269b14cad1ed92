# SPDX-License-Identifier: Apache-2.0
"""SLAMs on a simulated tour, into a run's folder."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from scripts.console import note
from scripts.film.footage import of_scene
from scripts.knobs import Held
from scripts.single_run.session import Outputs, run_session


def tour(  # noqa: PLR0913 (options of a verb)
    scene: str,
    seconds: float,
    dynamism: float,
    seed: int,
    scan_height_m: float,
    scanner: str,
    held: Held | None = None,
) -> dict[str, Any]:
    """The settings of a tour, as ``on_scene`` takes them."""
    world = {"scene": scene, "dynamism": dynamism, **(held or Held()).given(), "seed": seed}
    return {**world, "seconds": seconds, "scan_height_m": scan_height_m, "laser": scanner}


def on_scene(names: list[str], settings: Mapping[str, Any], outputs: Outputs) -> dict[str, Any]:
    """Run SLAMs on a tour of a scene.

    settings  scene, seconds, dynamism, seed; further keys go to ``Simulation``
    """
    with of_scene(settings, view="follow" if outputs.film else None) as footage:
        show = footage.show(names)
        if outputs.film and footage.no_camera:
            note(f"the film has no 3D panel: {footage.no_camera}")
        recipe = {"slams": list(show.replay.tracks), **settings, **footage.made_with}
        return run_session(footage.stream, show, replace(outputs, settings=recipe))
