# SPDX-License-Identifier: Apache-2.0
"""One picture of every kind of mover for docs/crowds.md.

``python -m scripts.experiments.crowd_pictures``.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from scripts.experiments.scene_pictures import save
from sim.driving.pilot import Pilot
from sim.simulation import Simulation
from sim.view import gl
from sim.view.camera import Camera

SIZE = (288, 216)  # px, of one of them
COLUMNS = 4
OVERSAMPLING = 2
MAX_BYTES = 300_000
BAND_PX = 20  # under what is written
LASER = "scanner(fov_deg=180,beams=31,rate_hz=5,sigma_m=0.01)"  # nobody looks at its scans


@dataclass(frozen=True, kw_only=True)
class Shot:
    """Who is seen, at what time s of which scene, from where."""

    kind: str
    scene: str
    crowd: str
    who: str
    at_s: float
    seed: int = 0
    far_m: float = 5.0
    azimuth_deg: float = 60.0


SHOTS = (
    Shot(kind="escorts", scene="arena", crowd="escorts:6", who="robot", at_s=6.0),
    Shot(
        kind="streams",
        scene="corridor",
        crowd="streams:8",
        who="stream0",
        at_s=6.0,
        azimuth_deg=20.0,
    ),
    Shot(kind="groups", scene="gallery", crowd="groups:4", who="group0", at_s=2.0),
    Shot(kind="queue", scene="station", crowd="queue:6", who="queue2", at_s=1.0, far_m=6.0),
    Shot(kind="boards", scene="arena", crowd="boards:1", who="board0", at_s=8.0, azimuth_deg=150.0),
    Shot(kind="beds", scene="corridor", crowd="beds:1", who="bed0", at_s=8.0, azimuth_deg=30.0),
    Shot(kind="trains", scene="station", crowd="trains:1", who="wagon0", at_s=12.0),
    Shot(
        kind="couches",
        scene="station",
        crowd="couches:1",
        who="couch0",
        at_s=10.0,
        seed=1,
        azimuth_deg=150.0,
    ),
    Shot(
        kind="cleaners",
        scene="arena",
        crowd="cleaners:1",
        who="cleaner0",
        at_s=25.0,
        seed=1,
        azimuth_deg=240.0,
    ),
    Shot(kind="doors", scene="office", crowd="streams:8", who="door0", at_s=10.0),
    Shot(kind="sliding doors", scene="station", crowd="streams:30", who="door0", at_s=15.0),
    Shot(kind="lift", scene="station", crowd="escorts:14,streams:36", who="door2", at_s=23.2),
)


def draw(shot: Shot) -> NDArray[np.uint8]:
    """One of them, its kind written into it; (height, width, 3) RGB."""
    settings: dict[str, Any] = {"seed": shot.seed, "crowd": shot.crowd}
    simulation = Simulation(shot.scene, dynamism=0.0, motion=0.5, laser=LASER, **settings)
    world, pilot = simulation.world, Pilot(simulation.world)
    while world.time_ns < shot.at_s * 1e9:
        world.set_command(*pilot.command(simulation.scan_period_s))
        simulation.sense()
    x, y, yaw = world.mover_poses()[world.mover_names.index(shot.who)].tolist()
    if shot.who.startswith("door"):  # its pose is at the hinge
        x, y = x + 0.6 * float(np.cos(yaw)), y + 0.6 * float(np.sin(yaw))
    mujoco.mj_camlight(world.model, world.data)
    width, height = (OVERSAMPLING * side for side in SIZE)
    with Camera(world.model, width, height, samples=4) as camera:
        large = camera.close_up(world.data, (x, y), far_m=shot.far_m, azimuth_deg=shot.azimuth_deg)
    picture = np.array(Image.fromarray(large).resize(SIZE, Image.Resampling.LANCZOS))
    picture[-BAND_PX:] = (0.25 * picture[-BAND_PX:] + 0.75 * 250.0).astype(np.uint8)
    place, font = (6, SIZE[1] - 6), cv2.FONT_HERSHEY_SIMPLEX
    cv2.putText(picture, shot.kind, place, font, 0.45, (40, 44, 54), 1, cv2.LINE_AA)
    return picture


def main(arguments: list[str] | None = None) -> int:
    """Draw them all; 1 where there is no OpenGL."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("docs/pictures/crowds.png"))
    wanted = parser.parse_args(arguments)
    found = gl.find()
    if found.backend is None:
        print(f"No pictures drawn: {found.reason}. They need OpenGL (EGL or OSMesa).")
        return 1
    cells = [draw(shot) for shot in SHOTS]
    lines = [np.hstack(cells[k : k + COLUMNS]) for k in range(0, len(cells), COLUMNS)]
    wanted.out.parent.mkdir(parents=True, exist_ok=True)
    size = save(Image.fromarray(np.vstack(lines)), wanted.out)
    print(f"{wanted.out}  {size / 1000:.0f} kB" + ("  too big" if size > MAX_BYTES else ""))
    return 0


if __name__ == "__main__":
    sys.exit(main())
