# SPDX-License-Identifier: Apache-2.0
"""A simulated world as a film shows it: 3D view, the scan in the world, and what happened."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from scripts.film.chart import Bar
from scripts.film.draw import Picture
from scripts.film.layout import Layout
from scripts.film.scan_pane import beam_colors, beam_ends, silent_ends
from scripts.film.view import Bounds
from sim.events import KIDNAP, Event, EventWatch
from sim.moments import Moment
from sim.simulation import Simulation
from sim.view import gl
from sim.view.mapview import MapView
from sim.view.parts import Placed
from sim.view.pictures import CameraPicture
from sim.world.world import World
from slam import se2
from slam.frames import Frame


class LiveStage:
    """Shows a simulation while its moments pass; to be closed, for the camera.

    moments  a fresh run of moments each time it is called; ``simulation`` is the world they are of
    view     of the 3D camera, follow, top or persp; None for no 3D view
    """

    lanes: Sequence[str]
    world: World
    placed: Placed
    labelled = True

    def __init__(
        self,
        simulation: Simulation,
        moments: Callable[[], Iterator[Moment]],
        *,
        view: str | None = "follow",
    ) -> None:
        self._simulation, self._moments, self._angle = simulation, moments, view
        self._watch = EventWatch(simulation.world)
        self.lanes = self._watch.kinds
        self._camera: CameraPicture | None = None
        self._map: MapView | None = None
        self._moment: Moment | None = None
        self.world, self.placed = simulation.world, Placed.of(simulation.world)

    def frames(self) -> Iterator[Frame]:
        """The frames of a run; the stage shows the moment of the one given last."""
        self._watch = EventWatch(self._simulation.world)
        before = Placed.of(self.world)
        for moment in self._moments():
            self._moment = moment
            self.placed, before = before, Placed.of(self.world)
            self._watch.note(moment)
            yield moment.frame

    # -- as ``scripts.film.view.Stage`` -------------------------------------------------------

    @property
    def bounds(self) -> Bounds:
        """Of the scene's floor."""
        return self._simulation.world.scene.bounds

    @property
    def camera(self) -> bool:
        """Whether a 3D view is wanted and GL is there."""
        return self._angle is not None and gl.find().backend is not None

    def why_no_camera(self) -> str:
        """One line; empty where there is one, or none was wanted."""
        return "" if self.camera or self._angle is None else gl.find().reason

    def open(self, layout: Layout) -> None:
        """Make what paints the panes."""
        self._map = MapView(self._simulation.world.scene, *layout.scan.size)
        if layout.camera is not None and self._angle is not None:
            size = layout.camera.size
            self._camera = CameraPicture(self._simulation, size, self._angle, shadows=False)

    def scan(self, frame: Frame) -> Picture:
        """The room from above, the scan in it, beams by what they hit."""
        assert self._map is not None
        assert self._moment is not None
        if frame.scan is None or frame.truth is None:
            return self._map.draw(self._moment.poses)
        T_world_laser = se2.compose(frame.truth, frame.scan.spec.T_robot_laser)
        ends = beam_ends(frame.scan)
        silent = ~frame.scan.valid
        ends[silent] = silent_ends(frame.scan)
        hits = se2.transform(T_world_laser, ends)
        return self._map.draw(
            self._moment.poses, scan=(T_world_laser, hits), colours=beam_colors(frame)
        )

    def view(self) -> Picture:
        """What the 3D camera sees."""
        assert self._camera is not None
        return self._camera(self._simulation)

    def bars(self) -> Sequence[Bar]:
        """Events as stretches of time."""
        return [
            Bar(lane=e.kind, start_s=e.start_s, end_s=e.end_s, strong=e.seen)
            for e in self._watch.events()
            if e.kind != KIDNAP
        ]

    def events(self) -> Sequence[Event]:
        """What has happened so far."""
        return self._watch.events()

    def kidnaps(self) -> Sequence[float]:
        """Moments when the robot was put elsewhere, s."""
        return [e.start_s for e in self._watch.events() if e.kind == KIDNAP]

    def close(self) -> None:
        """Give the GL context back."""
        if self._camera is not None:
            self._camera.close()
            self._camera = None
