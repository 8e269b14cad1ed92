# SPDX-License-Identifier: Apache-2.0
"""``mobilia run``: SLAMs on a recorded log or a simulated tour, scored, mapped and filmed."""

from pathlib import Path
from typing import Annotated

import typer

from scripts import options
from scripts.names import check, run_name, scene_name
from slam.errors import InvalidValueError
from slam.variants import MAP_ORACLE


def run(
    slam: Annotated[
        list[str],
        typer.Argument(
            help="SLAMs to run, by name (see [bold]mobilia list[/bold]) or as module:Class. "
            "Odometry always runs beside them.",
            metavar="SLAM...",
        ),
    ],
    log: Annotated[
        Path | None,
        typer.Option(
            help="A log: a bag of ROS 1 or 2, CARMEN (.log, .clf), L/O in centimetres, an MRPT "
            ".rawlog, the folder of Victoria Park; or any text log with --format."
        ),
    ] = None,
    text_format: options.TextFormat = None,
    laser: options.Laser = None,
    flip: options.Flip = False,
    strict: options.Strict = False,
    scene: Annotated[
        str | None, typer.Option(help="Or a simulated scene, driven on a tour of its rooms.")
    ] = None,
    seconds: options.Seconds = 60.0,
    dynamism: options.DynamismLevel = 0.5,
    motion: options.Motion = None,
    change: options.Change = None,
    crowd: options.CrowdOption = None,
    events: options.EventsOption = None,
    robot: options.RobotOption = None,
    seed: options.Seed = 0,
    scan_height: options.ScanHeight = 0.36,
    scanner: options.Scanner = "full",
    out: Annotated[
        Path | None, typer.Option(help="Folder to write; default out/run-<log or scene>.")
    ] = None,
    overwrite: options.Overwrite = False,
    film: Annotated[bool, typer.Option(help="Write film.mp4.")] = True,
    plan_only: options.PlanOnly = False,
    map_in: Annotated[
        Path | None,
        typer.Option(help="Begin anywhere in this map of days before (docs/days.md); with --log."),
    ] = None,
    map_out: Annotated[
        Path | None, typer.Option(help="Keep the map, this session included; with --log.")
    ] = None,
    at: Annotated[
        str | None,
        typer.Option(help="When the session began, 2026-05-04T09:00; default the log's clock."),
    ] = None,
    oracle: options.Oracles = None,
    set_: options.Set = None,
) -> None:
    """Run SLAMs on a log or on a simulated scene and write the same files as the demo.

    [bold]mobilia run shunting --log intel.log.xz[/bold]

    [bold]mobilia run shunting my_package.my_slam:MySlam --scene arena --dynamism 1[/bold]
    """
    if (log is None) == (scene is None):
        raise InvalidValueError("name exactly one of --log and --scene")
    slams = list(options.with_oracles(options.named(list(slam)), oracle, set_))
    if MAP_ORACLE in slams:
        raise InvalidValueError("--oracle map is for compare and benchmark: they know the true map")
    check(slams, scene)
    if scene is not None:
        of_a_log = strict or flip or laser is not None or text_format is not None
        _without_a_log(strict=of_a_log, maps=bool(map_in or map_out or at))
        from scripts.single_run.run import on_scene
        from scripts.single_run.session import Outputs

        folder = out or Path("out") / f"run-{scene_name(scene)}"
        outputs = Outputs(folder=folder, command="run", overwrite=overwrite, film=film)
        held = options.Held(motion=motion, change=change, crowd=crowd)
        settings = held.world(scene, dynamism, seed) | {
            "seconds": seconds, "scan_height_m": scan_height, "laser": scanner,
            **options.staged(events, robot),
        }  # fmt: skip
        on_scene(slams, settings, outputs, plan_only=plan_only)
    elif log is not None:
        from scripts.pace import announce, timed
        from scripts.single_run.run import Log, Maps, on_log, on_log_work

        maps = Maps(map_in=map_in, map_out=map_out, at=at)
        folder = out or Path("out") / f"run-{run_name(log)}"
        recorded = Log(path=log, strict=strict, text_format=text_format, laser=laser, flip=flip)
        work = on_log_work(slams, log, film)
        announce(f"{log.name}, {work.amount / len(slams):.1f} MB" + ", filmed" * film, [work])
        if not plan_only:
            with timed(work):
                on_log(slams, recorded, folder, overwrite=overwrite, film=film, maps=maps)


def _without_a_log(*, strict: bool, maps: bool) -> None:
    """``InvalidValueError`` where options about a log were given beside a scene."""
    if strict:
        raise InvalidValueError("--strict, --format, --laser and --flip are about a --log")
    if maps:
        raise InvalidValueError("--map-in, --map-out and --at are about a --log")
