# SPDX-License-Identifier: Apache-2.0
"""Pictures and clips of the pages: ``python -m scripts.experiments.pictures [NAME ...]``.

``scene_NAME`` is the picture of a scene (docs/scenes.md, as it starts) and its clip, ``track_NAME``
those of a track of the benchmark at level 1 (docs/gallery.md), ``crowds`` one picture of every kind
of mover (docs/crowds.md). Without a name all are made. The gallery then links each picture to the
clip that there is of it. No SLAM runs. Needs OpenGL.
"""

import argparse
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import mujoco
import numpy as np
from PIL import Image

import scenes
from scripts.benchmark.tracks import newest
from scripts.console import ended
from scripts.film.encode import film
from sim.driving.pilot import Pilot
from sim.simulation import Simulation
from sim.view import gl
from sim.view.camera import Camera
from sim.view.draw import Picture
from slam.errors import UnknownNameError
from slam.files import replacing, write_text

LASER = "scanner(fov_deg=180,beams=31,rate_hz=5,sigma_m=0.01)"  # nobody looks at its scans
SCENE_PX, CLIP_PX, CROWD_PX = (960, 540), (480, 270), (288, 216)
OVERSAMPLING = 2  # drawn larger, then averaged: cleaner thin legs
FPS = 10.0  # pictures a second of clip; with 5 scans a second it runs at twice real time
PICTURES = 60  # of a clip
CRF = 31  # H.264: small files
MAX_BYTES = 300_000  # of a file kept in docs/
SCENE_SEED, TRACK_SEED = 3, 720
COLUMNS, BAND_PX = 4, 20  # of the crowds; what is written stands in a band
CROWDS = "crowds"
PAGE = Path("docs/gallery.md")
_PICTURE = re.compile(
    r"^\[?(!\[[^]\n]*\]\(pictures/(?:gallery/)?(\w[\w.-]*)\.png\))(?:\]\([^)\n]*\))?$", re.M
)


@dataclass(frozen=True, kw_only=True)
class Shot:
    """What is seen.

    settings  of ``Simulation``
    from_s    simulated time of the first picture, s
    view      a camera of the scene; "": one that looks at ``who`` (the robot, or a mover) from
    far_m, azimuth_deg, down_deg  there (``Camera.close_up``)
    """

    settings: dict[str, Any] = field(repr=False)
    from_s: float
    view: str = ""
    who: str = "robot"
    far_m: float = 9.0
    azimuth_deg: float = 60.0
    down_deg: float = 45.0


# Of a track, where the usual shot shows too little of what it is about.
_TRACK_SHOTS: dict[str, dict[str, Any]] = {
    "rush-hour": {"from_s": 12.0, "far_m": 16.0, "down_deg": 40.0},
    "busy-chairs": {"view": "top"},
    "moving-boards": {"from_s": 8.0, "far_m": 11.0},
    "slow-boards": {"from_s": 20.0, "far_m": 11.0},
    "half-turn": {"from_s": 8.0, "view": "top"},
    "depth-camera": {"from_s": 12.0, "far_m": 13.0},
    "moving-day": {"from_s": 40.0, "view": "top"},
    "ward-round": {"from_s": 36.0, "view": "top"},
    "overnight": {"from_s": 54.0, "view": "top"},
    "kidnapped-in-a-crowd": {"from_s": 54.0, "view": "top"},
    "warehouse-shift": {"from_s": 8.0, "far_m": 12.0},
    "classroom-break": {"from_s": 6.0, "far_m": 10.0},
    "no-walls": {"from_s": 6.0, "far_m": 11.0},
}
# Kind of mover -> scene, crowd, who is seen, when (s), and from where.
_CROWD_SHOTS: dict[str, tuple[str, str, str, float, dict[str, Any]]] = {
    "escorts": ("arena", "escorts:6", "robot", 6.0, {}),
    "streams": ("corridor", "streams:8", "stream0", 6.0, {"azimuth_deg": 20.0}),
    "groups": ("gallery", "groups:4", "group0", 2.0, {}),
    "queue": ("station", "queue:6", "queue2", 1.0, {"far_m": 6.0}),
    "boards": ("arena", "boards:1", "board0", 8.0, {"azimuth_deg": 150.0}),
    "beds": ("corridor", "beds:1", "bed0", 8.0, {"azimuth_deg": 30.0}),
    "trains": ("station", "trains:1", "wagon0", 12.0, {}),
    "couches": ("station", "couches:1", "couch0", 10.0, {"seed": 1, "azimuth_deg": 150.0}),
    "cleaners": ("arena", "cleaners:1", "cleaner0", 25.0, {"seed": 1, "azimuth_deg": 240.0}),
    "doors": ("office", "streams:8", "door0", 10.0, {}),
    "sliding doors": ("station", "streams:30", "door0", 15.0, {}),
    "lift": ("station", "escorts:14,streams:36", "door2", 23.2, {}),
}  # fmt: skip


def clips() -> dict[str, Shot]:
    """Of every track and scene, by the names of their files."""
    found = {}
    for family, track in newest().items():
        plan = track.plan((), (TRACK_SEED,))
        recipe = plan.recipe(plan.runs()[-1])
        settings = {**recipe.simulation(), "laser": LASER, "labels": False}
        own = {"from_s": 6.0, **_TRACK_SHOTS.get(family, {})}
        found[f"track_{family}"] = Shot(settings=settings, **own)
    for name in scenes.names():
        settings = {"scene": name, "seed": SCENE_SEED, "dynamism": 1.0, "laser": LASER}
        found[f"scene_{name}"] = Shot(settings=settings, from_s=2.0, view="persp")
    return found


def crowd(kind: str) -> Shot:
    """Of one of ``_CROWD_SHOTS``."""
    scene, who_is_there, who, at_s, more = _CROWD_SHOTS[kind]
    where = {"far_m": 5.0, "down_deg": 35.0, "seed": 0, **more}
    settings = {"scene": scene, "crowd": who_is_there, "seed": where.pop("seed"), "dynamism": 0.0,
                "motion": 0.5, "laser": LASER}  # fmt: skip
    return Shot(settings=settings, from_s=at_s, who=who, **where)


def pictures(shot: Shot, size: tuple[int, int], count: int) -> Iterator[Picture]:
    """So many pictures, one a scan, (height, width, 3) RGB."""
    simulation = Simulation(**shot.settings)
    world, pilot = simulation.world, Pilot(simulation.world)
    n_before = round(shot.from_s / simulation.scan_period_s)
    with Camera(world.model, *size, samples=4) as camera:
        for k in range(n_before + count):
            world.set_command(*pilot.command(simulation.scan_period_s))
            simulation.sense()
            if k < n_before:
                continue
            mujoco.mj_camlight(world.model, world.data)
            if shot.view:
                yield camera.render(world.data, shot.view)
                continue
            x, y, yaw = world.mover_poses()[world.mover_names.index(shot.who)].tolist()
            if shot.who.startswith("door"):  # its pose is at the hinge
                x, y = x + 0.6 * float(np.cos(yaw)), y + 0.6 * float(np.sin(yaw))
            yield camera.close_up(
                world.data, (x, y), far_m=shot.far_m, azimuth_deg=shot.azimuth_deg,
                down_deg=shot.down_deg,
            )  # fmt: skip


def scene_picture(name: str) -> Image.Image:
    """A scene as it starts."""
    scene = scenes.build(name, SCENE_SEED)
    model = scene.compile()
    data = mujoco.MjData(model)
    scene.place(model, data)
    mujoco.mj_forward(model, data)
    with Camera(model, *_large(SCENE_PX), samples=4) as camera:
        return _small(camera.render(data, "persp"), SCENE_PX)


def crowd_picture() -> Image.Image:
    """Every kind of mover, its name written into its picture."""
    cells = []
    for kind in _CROWD_SHOTS:
        large = next(pictures(crowd(kind), _large(CROWD_PX), 1))
        one = np.array(_small(large, CROWD_PX))
        one[-BAND_PX:] = (0.25 * one[-BAND_PX:] + 0.75 * 250.0).astype(np.uint8)
        place, font = (6, CROWD_PX[1] - 6), cv2.FONT_HERSHEY_SIMPLEX
        cv2.putText(one, kind, place, font, 0.45, (40, 44, 54), 1, cv2.LINE_AA)
        cells.append(one)
    lines = [np.hstack(cells[k : k + COLUMNS]) for k in range(0, len(cells), COLUMNS)]
    return Image.fromarray(np.vstack(lines))


def _large(size: tuple[int, int]) -> tuple[int, int]:
    return OVERSAMPLING * size[0], OVERSAMPLING * size[1]


def _small(picture: Picture, size: tuple[int, int]) -> Image.Image:
    return Image.fromarray(picture).resize(size, Image.Resampling.LANCZOS)


def save(picture: Image.Image, path: Path) -> Path:
    """Write a PNG of 256 colours, spread so that the few plants keep their green."""
    small = picture.quantize(
        256, method=Image.Quantize.MAXCOVERAGE, kmeans=2, dither=Image.Dither.NONE
    )
    with replacing(path) as temporary:
        small.save(temporary, format="PNG", optimize=True)
    return path


def make(name: str, out: Path) -> list[Path]:
    """The files of one of the names."""
    if name == CROWDS:
        return [save(crowd_picture(), out / f"{CROWDS}.png")]
    clip = out / "gallery" / f"{name}.mp4"
    made = [clip]
    if name.startswith("scene_"):
        made.append(save(scene_picture(name.removeprefix("scene_")), out / f"{name}.png"))
    with film(clip, FPS, crf=CRF) as reel:
        for k, picture in enumerate(pictures(clips()[name], CLIP_PX, PICTURES)):
            reel.add(np.ascontiguousarray(picture))
            if k == PICTURES // 2 and name.startswith("track_"):
                made.append(save(Image.fromarray(picture), clip.with_suffix(".png")))
    return made


def with_clips(text: str, clips: Path) -> str:
    """The page with each picture linked to its clip, where the folder has one."""

    def linked(found: re.Match[str]) -> str:
        clip = f"{found[2]}.mp4"
        return f"[{found[1]}](pictures/gallery/{clip})" if (clips / clip).exists() else found[1]

    return _PICTURE.sub(linked, text)


@ended
def main(arguments: list[str] | None = None) -> int:
    """Make those asked for, all by default; 1 where there is no OpenGL."""
    known = [*clips(), CROWDS]
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(known))
    parser.add_argument("--out", type=Path, default=PAGE.parent / "pictures")
    wanted = parser.parse_args(arguments)
    if unknown := sorted(set(wanted.names) - set(known)):
        raise UnknownNameError(f"no picture {unknown[0]!r}; there are: {', '.join(known)}")
    found = gl.find()
    if found.backend is None:
        print(f"No pictures drawn: {found.reason}. They need OpenGL (EGL or OSMesa).")
        return 1
    for name in wanted.names or known:
        for path in make(name, wanted.out):
            size = path.stat().st_size
            print(f"{path}  {size / 1000:.0f} kB{'  too big' if size > MAX_BYTES else ''}")
    if wanted.out.resolve().is_relative_to(PAGE.parent.resolve()):
        write_text(PAGE, with_clips(PAGE.read_text(encoding="utf-8"), wanted.out / "gallery"))
    return 0


if __name__ == "__main__":
    sys.exit(main())
