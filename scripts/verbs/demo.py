# SPDX-License-Identifier: Apache-2.0
"""``mobilia demo``: a minute of a moving office, the shunting SLAM against odometry."""

from pathlib import Path
from typing import Annotated

import typer

from scripts import options
from scripts.names import check

FILM_FPS = 15.0  # the whole demo is to last a minute on two cores


def demo(
    out: Annotated[Path, typer.Option(help="Folder to write.")] = Path("out/demo"),
    scene: Annotated[str, typer.Option(help="Scene to drive in.")] = "office",
    seconds: options.Seconds = 60.0,
    dynamism: options.DynamismLevel = 0.5,
    motion: options.Motion = None,
    change: options.Change = 0.0,
    crowd: options.CrowdOption = "none",
    seed: options.Seed = 2,
    scan_height: options.ScanHeight = 0.36,
    scanner: options.Scanner = "full",
    overwrite: options.Overwrite = False,
    film: Annotated[bool, typer.Option(help="Write film.mp4.")] = True,
    plan_only: options.PlanOnly = False,
) -> None:
    """Drive a robot through a moving office, and compare SLAM with odometry.

    Writes a film, the map (PNG, and PGM + YAML for ROS map_server), trajectories (TUM, for evo),
    errors over time, all numbers as JSON and the recipe that made them. About a minute, and half a
    minute more the first time, while Numba compiles. The default seed drives 22 m and ends after
    a chair was taken away (changes.png); try others. Nobody accompanies the robot, and
    nothing changes out of sight, unless --crowd and --change say so.
    """
    check(["shunting"], scene)
    from scripts.single_run.run import on_scene
    from scripts.single_run.session import Outputs

    outputs = Outputs(folder=out, command="demo", overwrite=overwrite, film=film, film_fps=FILM_FPS)
    held = options.Held(motion=motion, change=change, crowd=crowd)
    settings = held.world(scene, dynamism, seed) | {
        "seconds": seconds, "scan_height_m": scan_height, "laser": scanner,
    }  # fmt: skip
    on_scene(["shunting"], settings, outputs, plan_only=plan_only)
