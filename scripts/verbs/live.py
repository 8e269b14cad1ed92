# SPDX-License-Identifier: Apache-2.0
"""``mobilia live``: a running world or a log in a viewer, to watch, to steer and to disturb."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from scripts.console import console, note
from scripts.knobs import Change, CrowdOption, Held, Motion
from scripts.live import FASTEST, SLOWEST
from scripts.names import check
from scripts.scanner_option import Scanner
from slam.errors import InvalidValueError
from slam.set_numbers import with_set

if TYPE_CHECKING:
    from scripts.live.opened import Opened

PORT = 8765  # where Foxglove looks first
LAYOUT = Path(__file__).parents[1] / "live" / "layout.json"


def live(
    scene: Annotated[
        str | None, typer.Argument(help="A scene by name, or module:function.")
    ] = None,
    slam: Annotated[
        list[str] | None,
        typer.Option(help="SLAMs by name or module:Class: --slam A B C; default shunting."),
    ] = None,
    log: Annotated[Path | None, typer.Option(help="Instead of a scene: a log.")] = None,
    bag: Annotated[Path | None, typer.Option(help="Instead of a scene: a bag of ROS.")] = None,
    seconds: Annotated[float, typer.Option(help="How long the scene lives, s.")] = 3600.0,
    dynamism: Annotated[
        float, typer.Option(help="How much the room moves: 0 nothing, 1 most.")
    ] = 0.5,
    motion: Motion = None,
    change: Change = None,
    crowd: CrowdOption = None,
    seed: Annotated[int, typer.Option(help="Seed of the scene, whole number >= 0.")] = 0,
    scanner: Scanner = "full",
    paused: Annotated[bool, typer.Option("--paused", help="Wait for play.")] = False,
    speed: Annotated[float, typer.Option(help="1 is real time.")] = 1.0,
    host: Annotated[
        str, typer.Option(help="Address to listen at; any but loopback lets others in.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="Port to listen at, 0 for any that is free.")] = PORT,
    allow_origin: Annotated[
        list[str] | None,
        typer.Option(help="A web page that may connect: https://host[:port]; repeatable."),
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", help="[SLAM.]PATH=VALUE, see mobilia config SLAM; repeatable."),
    ] = None,
) -> None:
    """Serve a running world over the Foxglove WebSocket: watch it, drive in it, push its chairs.

    Open Foxglove or Lichtblick, connect to ws://127.0.0.1:8765 and import the layout that is named
    when this starts. Ctrl-C ends it. Nothing is written.

    [bold]mobilia live office --slam shunting[/bold]

    [bold]mobilia live --log intel.log.xz --slam shunting occupancy[/bold]
    """
    path = _file(scene, log, bag)
    if not 0 <= port <= 65535:
        raise InvalidValueError(f"--port must lie in 0..65535, got {port}")
    if not SLOWEST <= speed <= FASTEST:
        raise InvalidValueError(f"--speed must lie in [{SLOWEST:g}, {FASTEST:g}], got {speed:g}")
    slams = list(with_set(slam or ["shunting"], set_ or []))
    check(slams, scene)
    from scripts.live import gate, opened, sdk

    origins = [gate.origin_of(text) for text in allow_origin or []]

    found = sdk.require()
    if path is not None:
        served = opened.of_file(slams, path)
    else:
        held = Held(motion=motion, change=change, crowd=crowd)
        world = {"scene": scene, "dynamism": dynamism, **held.given(), "seed": seed}
        served = opened.of_scene(slams, {**world, "laser": scanner}, seconds)
    _serve(found, served, (host, port), origins, playing=not paused, speed=speed)


def _file(scene: str | None, log: Path | None, bag: Path | None) -> Path | None:
    """The log or bag, None for a scene; one of the three must be named."""
    given = [what for what in (scene, log, bag) if what is not None]
    if len(given) != 1:
        raise InvalidValueError("name exactly one of a scene, --log and --bag")
    return log if log is not None else bag


def _serve(
    found: object, served: Opened, address: tuple[str, int], origins: list[str], *,
    playing: bool, speed: float,
) -> None:  # fmt: skip
    from scripts.live.playback import Playback
    from scripts.live.sdk import Sdk
    from scripts.live.view import View

    assert isinstance(found, Sdk)
    session, shown_ns = served
    playback = Playback(session.run(), playing=playing, speed=speed)
    view = View(found, session, playback, address, shown_ns, origins)
    try:
        host = address[0]
        if view.token:
            note(
                f"--host {host}: whoever has the address below can watch, drive the robot and "
                "move things. There is no encryption."
            )
        path = f"/{view.token}" if view.token else ""
        console.print(
            f"Serving at [bold]ws://{escape(host)}:{view.port}{path}[/bold]; layout: "
            f"{escape(str(LAYOUT))}. Ctrl-C ends it.",
            soft_wrap=True,
        )
        while True:
            view.turn()
    finally:
        view.close()
