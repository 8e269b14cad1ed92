# SPDX-License-Identifier: Apache-2.0
"""What a film can show of the true world: nothing but the scan for a log."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

from scripts.film.chart import Bar
from scripts.film.draw import Picture
from scripts.film.layout import Layout
from scripts.film.scan_pane import RobotScan
from slam.frames import Frame

if TYPE_CHECKING:  # logs are filmed without the simulator
    from sim.events import Event
    from sim.view.parts import Placed
    from sim.world.world import World

Bounds = tuple[float, float, float, float]


class Stage(Protocol):
    """What ``Show`` asks for.

    bounds    xmin, ymin, xmax, ymax (m) of the world, None where nobody knows it
    camera    whether there is a 3D view
    labelled  whether beams say what they hit
    lanes     kinds of events that can be
    world     that is simulated, None for a log;   placed  where its parts were at the scan's start
    """

    @property
    def world(self) -> World | None:
        """As above."""

    @property
    def placed(self) -> Placed | None:
        """As above."""

    @property
    def bounds(self) -> Bounds | None:
        """As above."""

    @property
    def camera(self) -> bool:
        """As above."""

    @property
    def labelled(self) -> bool:
        """As above."""

    @property
    def lanes(self) -> Sequence[str]:
        """As above."""

    def open(self, layout: Layout) -> None:
        """Get ready to paint; called once before the first picture."""

    def scan(self, frame: Frame) -> Picture:
        """The pane of the scan."""

    def view(self) -> Picture:
        """The 3D view; only where ``camera`` is true."""

    def bars(self) -> Sequence[Bar]:
        """What has happened so far."""

    def events(self) -> Sequence[Event]:
        """The same in the simulator's words, with when the robot was put elsewhere."""

    def kidnaps(self) -> Sequence[float]:
        """Moments when the robot was put elsewhere, s."""


class LogStage:
    """A log: the robot's own scan, in its own frame."""

    bounds: Bounds | None = None
    camera = False
    lanes: Sequence[str] = ()
    world = placed = None

    def __init__(self, *, labelled: bool = False) -> None:
        self.labelled = labelled
        self._pane: RobotScan | None = None

    def open(self, layout: Layout) -> None:
        """Of the size that the layout gives."""
        self._pane = RobotScan(layout.scan.size, layout.unit)

    def scan(self, frame: Frame) -> Picture:
        """The scan around the robot."""
        assert self._pane is not None
        return self._pane(frame)

    def view(self) -> Picture:
        """Nobody filmed it."""
        raise NotImplementedError("a log has no 3D view")

    def bars(self) -> Sequence[Bar]:
        """Nobody noted them."""
        return ()

    def kidnaps(self) -> Sequence[float]:
        """Nobody noted them."""
        return ()

    def events(self) -> Sequence[Event]:
        """Nobody noted them."""
        return ()
