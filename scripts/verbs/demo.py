# SPDX-License-Identifier: Apache-2.0
"""``mobilia demo``: a minute of a moving office, the shunting SLAM against odometry."""

from pathlib import Path

from scripts import options
from scripts.names import check
from scripts.spec import SCENES, option, part, spec

FILM_FPS = 15.0  # the whole demo is to last a minute on two cores


@spec
class Demo:
    """Drive a robot through a moving office, and compare SLAM with odometry.

    Writes a film, the map (PNG, and PGM + YAML for ROS map_server), trajectories (TUM, for evo),
    errors over time, all numbers as JSON and the recipe that made them. About a minute, and half a
    minute more the first time, while Numba compiles. The default seed drives 22 m and ends after
    a chair was taken away (changes.png); try others. Nobody accompanies the robot, and
    nothing changes out of sight, unless --crowd and --change say so.
    """

    out: Path = option("Folder to write.", Path("out/demo"), writes=True)
    scene: str = option("Scene to drive in.", "office", complete=SCENES)
    tour: options.Tour = part(
        options.Tour, without=("events", "robot", "also_at"), change=0.0, crowd="none", seed=2
    )
    overwrite: bool = options.OVERWRITE()
    film: bool = options.FILM(True)
    plan_only: bool = options.PLAN()

    def __call__(self) -> None:
        check(["shunting"], self.scene)
        from scripts.single_run.run import on_scene
        from scripts.single_run.session import Outputs

        outputs = Outputs(
            folder=self.out, command="demo", overwrite=self.overwrite, film=self.film,
            film_fps=FILM_FPS,
        )  # fmt: skip
        settings = self.tour.settings(self.scene)
        on_scene(["shunting"], settings, outputs, plan_only=self.plan_only)
