# SPDX-License-Identifier: Apache-2.0
"""``mobilia live``: a running world or a log as a page, to watch, to steer and to disturb."""

import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from scripts import options
from scripts.console import note, say
from scripts.live import FASTEST, SLOWEST
from scripts.names import check
from slam.errors import InvalidValueError
from slam.set_numbers import with_set

if TYPE_CHECKING:
    from scripts.live.session import Opener
    from scripts.live.view import Network

PORT = 8765


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
    dynamism: options.DynamismLevel = 0.5,
    motion: options.Motion = None,
    change: options.Change = None,
    crowd: options.CrowdOption = None,
    events: options.EventsOption = None,
    robot: options.RobotOption = None,
    seed: Annotated[int, typer.Option(help="Seed of the scene, whole number >= 0.")] = 0,
    scanner: options.Scanner = "full",
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
    browser: Annotated[
        bool, typer.Option("--open", help="Open the page in this machine's browser, too.")
    ] = False,
    ros2: Annotated[
        str | None,
        typer.Option(help="The robot on a network of ROS 2 as well: dds or zenoh (docs/ros2.md)."),
    ] = None,
    set_: options.Set = None,
) -> None:
    """Open a page with a running world: watch it, drive in it, push its chairs.

    Any browser shows it, at http://127.0.0.1:8765. Ctrl-C ends it. Nothing is written.

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
    from scripts.live import served, session

    allowed = [served.origin_of(text) for text in allow_origin or []]
    served.require()
    held = options.Held(motion=motion, change=change, crowd=crowd)
    world = {**held.world(scene, dynamism, seed), "laser": scanner, **options.staged(events, robot)}
    opener = session.Opener(
        slams=slams, path=path, settings=world if path is None else {}, seconds=seconds
    )
    network = None if ros2 is None else _network(ros2, is_log=path is not None)
    _serve(
        opener, (host, port), allowed, playing=not paused, speed=speed, browser=browser,
        network=network,
    )  # fmt: skip


def _file(scene: str | None, log: Path | None, bag: Path | None) -> Path | None:
    """The log or bag, None for a scene; one of the three must be named."""
    given = [what for what in (scene, log, bag) if what is not None]
    if len(given) != 1:
        raise InvalidValueError("name exactly one of a scene, --log and --bag")
    return log if log is not None else bag


def _network(middleware: str, *, is_log: bool) -> "Network":
    """The robot on the network; ``InvalidValueError``, ``MissingDependencyError``."""
    from scripts.live.view import Network
    from slam.ros.link import domain_of_environment, open_link, open_to_others

    network = Network(open_link(middleware))
    whom = "others on the network" if open_to_others() else "this machine's nodes"
    note(
        f"ROS 2 over {middleware}, ROS_DOMAIN_ID {domain_of_environment()}: {whom} see the robot"
        f"{'' if is_log else ', drive it and move things'}."
    )
    return network


def _serve(
    opener: "Opener", address: tuple[str, int], origins: list[str], *, playing: bool, speed: float,
    browser: bool = False, network: "Network | None" = None,
) -> None:  # fmt: skip
    from scripts.live.view import View

    view = View(opener, address, origins, playing=playing, speed=speed, network=network)
    try:
        host, token = address[0], view.served.token
        if token:
            note(
                f"--host {host}: whoever has the address below can watch, drive the robot and "
                "move things. There is no encryption."
            )
        url = f"http://{host}:{view.served.port}/{token}"
        say(f"Open [bold]{escape(url)}[/bold] in a browser. Ctrl-C ends it.")
        if browser:
            webbrowser.open(url)
        while True:
            view.turn()
    finally:
        view.close()
