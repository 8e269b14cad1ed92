# SPDX-License-Identifier: Apache-2.0
"""``replay.html``: a run to turn and to scrub, in one file that opens from disk.

    with Recorder.writing(path, moments, world, title="office", seconds=60.0) as recorder:
        for frame in ...:
            recorder.note(moments.note(frame, placed))

What is drawn is what the page of the live view draws (``scripts.live.drawn``), kept moment by
moment by viser's own recorder; nothing is served.
"""

import asyncio
import html
import importlib
import math
import threading
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from scripts.film.show import Show
from scripts.live.drawn import Drawn, look_at
from scripts.live.served import require
from sim.view.moment import Moments, Shown
from sim.world.world import World
from slam.files import replacing
from slam.frames import Frame

MOMENT_S = 0.1  # of the replay between two moments
MOST_MOMENTS = 1200  # of one file; a longer run is shown faster
FEW_PARTS = 900  # that move; of more, moments come less often, four times at the most
MOST_MAPS = 40  # that are drawn of one run


class Recorder:
    """Takes moments and makes a page of them."""

    def __init__(
        self, moments: Moments, world: World | None, *, title: str, seconds: float
    ) -> None:
        self._tape, self._scene, camera = _taped()
        self.moments, self._map_s = moments, seconds / MOST_MAPS
        self._drawn = Drawn(self._scene, moments, world, self._map_s)
        look_at(camera, self._drawn.bounds)
        parts = 0 if self._drawn.parts is None else self._drawn.parts.moving
        self._rest_s = MOMENT_S * min(max(1.0, parts / FEW_PARTS), 4.0)
        self._step_s = max(self._rest_s, seconds / MOST_MOMENTS)
        self._title, self._drawn_s = title, -math.inf
        xmin, _, _, ymax = self._drawn.bounds
        self._words = self._scene.add_label(
            "/words", title, position=(xmin, ymax, 2.6), anchor="bottom-left"
        )

    @classmethod
    @contextmanager
    def writing(
        cls, path: Path, moments: Moments, world: World | None = None, *, title: str, seconds: float
    ) -> "Iterator[Recorder]":
        """A page that appears under ``path`` when the block ends well."""
        recorder = cls(moments, world, title=title, seconds=seconds)
        with replacing(path) as temporary:
            yield recorder
            temporary.write_text(recorder.page(), encoding="utf-8")

    @classmethod
    def of(cls, path: Path, show: Show) -> "AbstractContextManager[Recorder]":
        """Of what a film shows."""
        world, seconds = show.stage.world, show.duration_s
        return cls.writing(path, show.moments, world, title=show.title, seconds=seconds)

    def note(self, shown: Shown | None) -> None:
        """Call for every moment."""
        if shown is None or shown.seconds - self._drawn_s < self._step_s - 1e-6:
            return
        if math.isfinite(self._drawn_s):  # a replay of at most two minutes, however long the run
            faster = self._step_s / self._rest_s
            self._tape.insert_sleep((shown.seconds - self._drawn_s) / faster)
        self._drawn_s = shown.seconds
        raster, landmarks = self.moments.look(self._map_s, self._map_s)
        self._drawn.draw(replace(shown, raster=raster, landmarks=landmarks))
        self._words.text = self._said(shown)

    def noting(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """``frames`` for a track to take; each is noted when the next is asked for."""
        for frame in frames:
            yield frame
            self.note(self.moments.note(frame))

    def page(self) -> str:
        """The file, whole: call it once."""
        self._tape.insert_sleep(MOMENT_S)
        page: str = self._tape.as_html()
        return page.replace("<title>Viser</title>", f"<title>{html.escape(self._title)}</title>", 1)

    def _said(self, shown: Shown) -> str:
        off_m, _ = shown.error(shown.primary)
        off = "" if math.isnan(off_m) else f", {100.0 * off_m:.1f} cm off"
        return f"{self._title} · {shown.seconds:.1f} s · {shown.primary}: {shown.verdict}{off}"


def _taped() -> tuple[Any, Any, Any]:
    """viser's recorder, scene and first camera, without the server that they come with."""
    viser = require()
    infra = importlib.import_module("viser.infra")
    buffer_class = importlib.import_module("viser.infra._async_message_buffer").AsyncMessageBuffer
    loop = asyncio.new_event_loop()
    loop.close()  # nobody waits for a message
    buffer = buffer_class(loop, persistent_messages=True)

    class Tape(infra.WebsockMessageHandler):  # type: ignore[misc, name-defined]
        def get_message_buffer(self) -> Any:
            return buffer

    handler = Tape()
    tape = handler.get_message_serializer(lambda message: message.include_in_scene_serialization)
    server = SimpleNamespace(_scene_lifecycle_lock=threading.RLock())
    owner = SimpleNamespace(client_id="", _websock_connection=handler, _viser_server=server)
    scene = viser.SceneApi(owner, ThreadPoolExecutor(1), loop)
    scene.set_up_direction("+z")
    camera = importlib.import_module("viser._viser").InitialCameraConfig(handler.queue_message)
    return tape, scene, camera
