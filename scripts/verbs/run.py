# SPDX-License-Identifier: Apache-2.0
"""``mobilia run``: SLAMs on a recorded log or a simulated tour, scored, mapped and filmed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scripts.knobs import Change, CrowdOption, Held, Motion
from scripts.names import check, run_name
from scripts.oracle_option import Oracles, with_oracles
from scripts.scanner_option import Scanner
from scripts.set_option import Set
from slam.errors import InvalidValueError


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
    text_format: Annotated[
        Path | None,
        typer.Option("--format", help="TOML file that says which columns of a text log hold what."),
    ] = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="Refuse a log that would have to be repaired.")
    ] = False,
    scene: Annotated[
        str | None, typer.Option(help="Or a simulated scene, driven on a tour of its rooms.")
    ] = None,
    seconds: Annotated[float, typer.Option(help="Length of the simulated tour, s.")] = 60.0,
    dynamism: Annotated[
        float, typer.Option(help="How much the simulated room moves: 0 nothing, 1 most.")
    ] = 0.5,
    motion: Motion = None,
    change: Change = None,
    crowd: CrowdOption = None,
    seed: Annotated[int, typer.Option(help="Seed of the simulated run, whole number >= 0.")] = 0,
    scan_height: Annotated[
        float, typer.Option(help="Height of the simulated scanner above the floor, m.")
    ] = 0.36,
    scanner: Scanner = "full",
    out: Annotated[
        Path | None, typer.Option(help="Folder to write; default out/run-<log or scene>.")
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace an earlier run in that folder.")
    ] = False,
    film: Annotated[bool, typer.Option(help="Write film.mp4.")] = True,
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
    oracle: Oracles = None,
    set_: Set = None,
) -> None:
    """Run SLAMs on a log or on a simulated scene and write the same files as the demo.

    [bold]mobilia run shunting --log intel.log.xz[/bold]

    [bold]mobilia run shunting my_package.my_slam:MySlam --scene arena --dynamism 1[/bold]
    """
    if (log is None) == (scene is None):
        raise InvalidValueError("name exactly one of --log and --scene")
    slam = list(with_oracles(slam, oracle, set_))
    check(slam, scene)
    if log is None and (strict or text_format is not None):
        raise InvalidValueError("--strict and --format are about a --log")
    if log is None and (map_in or map_out or at):
        raise InvalidValueError("--map-in, --map-out and --at are about a --log")
    if log is not None:
        from scripts.days.one import Maps
        from scripts.single_run.recorded import Log, on_log

        maps = Maps(map_in=map_in, map_out=map_out, at=at)
        folder = out or Path("out") / f"run-{run_name(log)}"
        recorded = Log(path=log, strict=strict, text_format=text_format)
        on_log(slam, recorded, folder, overwrite=overwrite, film=film, maps=maps)
    elif scene is not None:
        from scripts.single_run.live import on_scene, tour
        from scripts.single_run.session import Outputs

        folder = out or Path("out") / f"run-{scene.replace(':', '-')}"
        held = Held(motion=motion, change=change, crowd=crowd)
        settings = tour(scene, seconds, dynamism, seed, scan_height, scanner, held)
        on_scene(
            slam, settings, Outputs(folder=folder, command="run", overwrite=overwrite, film=film)
        )
