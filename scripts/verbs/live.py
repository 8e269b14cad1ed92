# SPDX-License-Identifier: Apache-2.0
"""``mobilia live``: a running world or a log as a page, to watch, to steer and to disturb."""

import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING

from rich.markup import escape

from scripts import options
from scripts.console import note, say
from scripts.live import FASTEST, SLOWEST
from scripts.names import check
from scripts.spec import SCENES, SLAMS, argument, option, part, spec
from slam.set_numbers import with_set

if TYPE_CHECKING:
    from scripts.live.session import Opener
    from scripts.live.view import Network

PORT = 8765


@spec
class Live:
    """Open a page with a running world: watch it, drive in it, push its chairs.

    Any browser shows it, at http://127.0.0.1:8765. Ctrl-C ends it. Nothing is written.

    [bold]mobilia live office --slam shunting[/bold]

    [bold]mobilia live --log intel.log.xz --slam shunting occupancy[/bold]
    """

    scene: str | None = argument("A scene by name, or module:function.", complete=SCENES)
    slam: list[str] | None = option(
        "SLAMs by name or module:Class: --slam A B C; default shunting.", complete=SLAMS
    )
    log: Path | None = option("Instead of a scene: a log.")
    bag: Path | None = option("Instead of a scene: a bag of ROS.")
    seconds: float = option("How long the scene lives, s.", 3600.0)
    moves: options.Moves = part(options.Moves)
    staged: options.Staged = part(options.Staged)
    seed: int = option("Seed of the scene, whole number >= 0.", 0)
    scanner: str = options.SCANNER()
    paused: bool = option("Wait for play.", False)
    speed: float = option("1 is real time.", 1.0, span=(SLOWEST, FASTEST))
    host: str = option("Address to listen at; any but loopback lets others in.", "127.0.0.1")
    port: int = option("Port to listen at, 0 for any that is free.", PORT, span=(0, 65535))
    allow_origin: list[str] | None = option(
        "A web page that may connect: https://host[:port]; repeatable."
    )
    browser: bool = option("Open the page in this machine's browser, too.", False, "--open")
    ros2: str | None = option(
        "The robot on a network of ROS 2 as well: dds or zenoh (docs/ros2.md).",
        choices=("dds", "zenoh"),
    )
    set_: list[str] | None = options.SET()

    def __call__(self) -> None:
        options.exactly_one("a scene, --log and --bag", self.scene, self.log, self.bag)
        path = self.log if self.log is not None else self.bag
        slams = list(with_set(self.slam or ["shunting"], self.set_ or []))
        check(slams, self.scene)
        from scripts.live import served, session

        allowed = [served.origin_of(text) for text in self.allow_origin or []]
        served.require()
        world = {
            **self.moves.world(self.scene, self.seed), "laser": self.scanner,
            **self.staged.settings(),
        }  # fmt: skip
        opener = session.Opener(
            slams=slams, path=path, settings=world if path is None else {}, seconds=self.seconds
        )
        network = None if self.ros2 is None else _network(self.ros2, is_log=path is not None)
        self.serve(opener, allowed, network)

    def serve(self, opener: "Opener", origins: list[str], network: "Network | None" = None) -> None:
        """The page, until something ends it."""
        from scripts.live.view import View

        view = View(
            opener, (self.host, self.port), origins, playing=not self.paused, speed=self.speed,
            network=network,
        )  # fmt: skip
        try:
            if view.served.token:
                note(
                    f"--host {self.host}: whoever has the address below can watch, drive the robot "
                    "and move things. There is no encryption."
                )
            url = f"http://{self.host}:{view.served.port}/{view.served.token}"
            say(f"Open [bold]{escape(url)}[/bold] in a browser. Ctrl-C ends it.")
            if self.browser:
                webbrowser.open(url)
            while True:
                view.turn()
        finally:
            view.close()


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
