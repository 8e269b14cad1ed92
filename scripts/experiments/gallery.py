# SPDX-License-Identifier: Apache-2.0
"""Pictures and clips for docs/gallery.md: each track of the benchmark at level 1, and each scene.

``python -m scripts.experiments.gallery`` makes all of them, ``... NAME NAME`` some. Of a scene only
the clip is made: its picture is that of docs/scenes.md (``scripts.experiments.scene_pictures``).
The page then links each picture to the clip that there is of it. No SLAM runs. Needs OpenGL.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from PIL import Image

import scenes
from scripts.benchmark.tracks import TRACKS
from scripts.experiments.scene_pictures import save
from scripts.film.draw import Picture
from scripts.film.encode import film
from sim.driving.pilot import Pilot
from sim.simulation import Simulation
from sim.view import gl
from sim.view.camera import Camera
from slam.files import write_text

SIZE = (480, 270)  # px
LASER = "scanner(fov_deg=180,beams=31,rate_hz=5,sigma_m=0.01)"  # nobody looks at its scans
FPS = 10.0  # pictures a second of clip; with 5 scans a second it runs at twice real time
PICTURES = 60  # of a clip
CRF = 31  # H.264: small files
MAX_BYTES = 250_000  # of a clip kept in docs/
SCENE_SEED, TRACK_SEED = 3, 720
SCENE_FROM_S = 2.0
PAGE = Path("docs/gallery.md")
_PICTURE = re.compile(
    r"^\[?(!\[[^]\n]*\]\(pictures/(?:gallery/)?(\w[\w.-]*)\.png\))(?:\]\([^)\n]*\))?$", re.M
)


@dataclass(frozen=True, kw_only=True)
class Shot:
    """What one clip shows.

    settings  of ``Simulation``
    from_s    simulated time of its first picture, s
    view      a camera of the scene; "": a camera that looks at the robot from
    far_m, azimuth_deg, down_deg  there (``Camera.close_up``)
    still     which of its pictures is kept as PNG too, from 0; None: none
    """

    name: str
    settings: dict[str, Any] = field(repr=False)
    from_s: float = SCENE_FROM_S
    view: str = ""
    far_m: float = 9.0
    azimuth_deg: float = 60.0
    down_deg: float = 45.0
    still: int | None = PICTURES // 2


# Of a track, where the usual shot shows too little of what it is about.
_SHOTS: dict[str, dict[str, Any]] = {
    "rush-hour-v1": {"from_s": 12.0, "far_m": 16.0, "down_deg": 40.0},
    "busy-chairs-v1": {"view": "top"},
    "moving-boards-v1": {"from_s": 8.0, "far_m": 11.0},
    "moving-day-v1": {"from_s": 40.0, "view": "top"},
    "overnight-v1": {"from_s": 54.0, "view": "top"},
    "kidnapped-in-a-crowd-v1": {"from_s": 54.0, "view": "top"},
    "warehouse-shift-v1": {"from_s": 8.0, "far_m": 12.0},
    "classroom-break-v1": {"from_s": 6.0, "far_m": 10.0},
    "no-walls-v1": {"from_s": 6.0, "far_m": 11.0},
}


def shots() -> dict[str, Shot]:
    """All of them, by the names of their files."""
    found = {}
    for name, track in TRACKS.items():
        plan = track.plan((), (TRACK_SEED,))
        recipe = plan.recipe(plan.runs()[-1])
        settings = {**recipe.simulation(), "laser": LASER, "labels": False}
        own = {"from_s": 6.0, **_SHOTS.get(name, {})}
        found[f"track_{name}"] = Shot(name=f"track_{name}", settings=settings, **own)
    for name in scenes.names():
        settings = {"scene": name, "seed": SCENE_SEED, "dynamism": 1.0, "laser": LASER}
        found[f"scene_{name}"] = Shot(
            name=f"scene_{name}", settings=settings, view="persp", still=None
        )
    return found


def pictures(shot: Shot) -> Iterator[Picture]:
    """The clip, picture by picture, (height, width, 3) RGB."""
    simulation = Simulation(**shot.settings)
    world, pilot = simulation.world, Pilot(simulation.world)
    n_before = round(shot.from_s / simulation.scan_period_s)
    with Camera(world.model, *SIZE, samples=4) as camera:
        for k in range(n_before + PICTURES):
            world.set_command(*pilot.command(simulation.scan_period_s))
            simulation.sense()
            if k < n_before:
                continue
            mujoco.mj_camlight(world.model, world.data)
            if shot.view:
                yield camera.render(world.data, shot.view)
                continue
            x, y, _ = world.robot_pose().tolist()
            yield camera.close_up(
                world.data, (x, y), far_m=shot.far_m, azimuth_deg=shot.azimuth_deg,
                down_deg=shot.down_deg,
            )  # fmt: skip


def make(shot: Shot, folder: Path) -> list[Path]:
    """Write the clip, and the picture where one is wanted; what was written."""
    clip, still = folder / f"{shot.name}.mp4", folder / f"{shot.name}.png"
    with film(clip, FPS, crf=CRF) as reel:
        for k, picture in enumerate(pictures(shot)):
            reel.add(np.ascontiguousarray(picture))
            if k == shot.still:
                save(Image.fromarray(picture), still)
    return [clip] if shot.still is None else [still, clip]


def with_clips(text: str, clips: Path) -> str:
    """The page with each picture linked to its clip, where the folder has one."""

    def linked(found: re.Match[str]) -> str:
        clip = f"{found[2]}.mp4"
        return f"[{found[1]}](pictures/gallery/{clip})" if (clips / clip).exists() else found[1]

    return _PICTURE.sub(linked, text)


def main(arguments: list[str] | None = None) -> int:
    """Make those asked for, all by default; 1 where there is no OpenGL."""
    known = shots()
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(known))
    parser.add_argument("--out", type=Path, default=PAGE.parent / "pictures" / "gallery")
    wanted = parser.parse_args(arguments)
    unknown = sorted(set(wanted.names) - set(known))
    if unknown:
        parser.error(f"no shot {unknown[0]!r}; there are: {', '.join(known)}")
    found = gl.find()
    if found.backend is None:
        print(f"No pictures drawn: {found.reason}. They need OpenGL (EGL or OSMesa).")
        return 1
    wanted.out.mkdir(parents=True, exist_ok=True)
    for name in wanted.names or known:
        for path in make(known[name], wanted.out):
            size, much = path.stat().st_size, "  too big"
            print(f"{path}  {size / 1000:.0f} kB{much if size > MAX_BYTES else ''}", flush=True)
    if wanted.out.resolve().is_relative_to(PAGE.parent.resolve()):
        write_text(PAGE, with_clips(PAGE.read_text(encoding="utf-8"), wanted.out))
    return 0


if __name__ == "__main__":
    sys.exit(main())
