# SPDX-License-Identifier: Apache-2.0
"""What can be shown of the true world: a room with its camera and events, of a log only scans."""

from collections.abc import Callable, Iterator, Sequence

from scripts.film.map_pane import RobotScan
from scripts.film.panes import Layout
from sim.events import Event, EventWatch
from sim.moments import Moment
from sim.simulation import Simulation
from sim.view import gl
from sim.view.camera import Camera
from sim.view.draw import Picture
from sim.view.mapview import MapView
from sim.view.parts import Placed
from sim.world.world import World
from slam.frames import Frame
from slam.logs.together import one_by_one

Bounds = tuple[float, float, float, float]


class Stage:
    """A log: the robot's own scan, in its own frame.

    labelled  whether beams say what they hit
    bounds    xmin, ymin, xmax, ymax (m) of the world, None where nobody knows it
    lanes     kinds of events that can be
    world     that is simulated, None for a log;   placed  where its parts were at the scan's start
    no_camera why there is no 3D view although one was wanted
    """

    bounds: Bounds | None = None
    camera = False
    lanes: Sequence[str] = ()
    world: World | None = None
    placed: Placed | None = None
    no_camera = ""

    def __init__(self, *, labelled: bool) -> None:
        self.labelled = labelled

    def open(self, layout: Layout) -> None:
        """Get ready to paint; called once before the first picture."""
        self._pane = RobotScan(layout.scan.size, layout.unit)

    def scan(self, frame: Frame) -> Picture:
        """The pane of the scan."""
        return self._pane(frame)

    def view(self) -> Picture:
        """The 3D view; only where ``camera`` is true."""
        raise NotImplementedError("a log has no 3D view")

    def events(self) -> Sequence[Event]:
        """What has happened so far, and when the robot was put elsewhere."""
        return ()

    def close(self) -> None:
        """Give back what it holds."""


class Room(Stage):
    """A simulation while its moments pass: 3D view, the scan in the world, and what happened.

    moments  a fresh run of moments each time it is called; ``simulation`` is the world they are of
    view     of the 3D camera, follow, top or persp; None for no 3D view
    """

    world: World

    def __init__(
        self, simulation: Simulation, moments: Callable[[], Iterator[Moment]], view: str | None
    ) -> None:
        super().__init__(labelled=True)
        self._moments, self._angle = moments, view
        self.world, self.placed = simulation.world, Placed.of(simulation.world)
        self.bounds = self.world.scene.bounds
        self._watch = EventWatch(self.world)
        self.lanes = self._watch.kinds
        self.camera = view is not None and gl.find().backend is not None
        self.no_camera = "" if self.camera or view is None else gl.find().reason
        self._camera: Camera | None = None

    def frames(self) -> Iterator[Frame]:
        """The frames of a run; the stage shows the moment of the one given last."""
        return one_by_one(self._frames())

    def _frames(self) -> Iterator[tuple[Frame, ...]]:
        self._watch = EventWatch(self.world)
        before = Placed.of(self.world)
        for moment in self._moments():
            self._moment = moment
            self.placed, before = before, Placed.of(self.world)
            self._watch.note(moment)
            yield moment.frames

    def open(self, layout: Layout) -> None:
        """Make what paints the panes."""
        self._map = MapView(self.world.scene, *layout.scan.size)
        if layout.camera is not None and self._angle is not None:
            self._camera = Camera(self.world.model, *layout.camera.size, shadows=False)

    def scan(self, frame: Frame) -> Picture:
        """The room from above, the scan in it, beams by what they hit."""
        return self._map.draw(self._moment.poses, frame)

    def view(self) -> Picture:
        """What the 3D camera sees."""
        assert self._camera is not None
        assert self._angle is not None
        return self._camera.render(self.world.data, self._angle)

    def events(self) -> Sequence[Event]:
        """As ``Stage.events``."""
        return self._watch.events()

    def close(self) -> None:
        """Give the GL context back."""
        if self._camera is not None:
            self._camera.close()
            self._camera = None
