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
import json
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
from scripts.live.drawn import Drawn, legend, look_at, told
from scripts.live.served import HEAD, require
from sim.view.moment import Moments, Shown
from sim.world.world import World
from slam.files import replacing
from slam.frames import Frame

MOMENT_S = 0.1  # of the replay between two moments
MOST_MOMENTS = 1200  # of one file; a longer run is shown faster
FEW_PARTS = 900  # that move; of more, moments come less often, four times at the most
MOST_MAPS = 40  # that are drawn of one run
WIDE, TALL = 1.7, 0.5  # pages: width by height
WORDS = Path(__file__).with_name("replay.html")


class Recorder:
    """Takes moments and makes a page of them."""

    def __init__(
        self, moments: Moments, world: World | None, *, title: str, seconds: float
    ) -> None:
        self._tape, self._scene = _taped()
        self.moments, self._map_s = moments, seconds / MOST_MAPS
        self._drawn = Drawn(self._scene, moments, world, self._map_s)
        parts = 0 if self._drawn.parts is None else self._drawn.parts.moving
        self._rest_s = MOMENT_S * min(max(1.0, parts / FEW_PARTS), 4.0)
        self._step_s = max(self._rest_s, seconds / MOST_MOMENTS)
        self._title, self._drawn_s, self._tape_s = title, -math.inf, 0.0
        self._told: list[tuple[float, str]] = []

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
            rest_s = (shown.seconds - self._drawn_s) * self._rest_s / self._step_s
            self._tape.insert_sleep(rest_s)
            self._tape_s += rest_s
        self._drawn_s = shown.seconds
        raster, landmarks = self.moments.look(self._map_s, self._map_s)
        self._drawn.draw(replace(shown, raster=raster, landmarks=landmarks))
        self._told.append((round(self._tape_s, 3), f"{shown.seconds:.1f} s · {told(shown)}"))

    def noting(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """``frames`` for a track to take; each is noted when the next is asked for."""
        for frame in frames:
            yield frame
            self.note(self.moments.note(frame))

    def page(self) -> str:
        """The file, whole: call it once."""
        self._tape.insert_sleep(MOMENT_S)
        page: str = self._tape.as_html()
        head = f"<title>{html.escape(self._title)}</title>{HEAD.read_text()}{self._words()}</head>"
        return page.replace("<title>Viser</title>", "", 1).replace("</head>", head, 1)

    def _words(self) -> str:
        """What stands over the scene, and where a wide and a tall page look from."""
        views = [SimpleNamespace(), SimpleNamespace()]
        for camera, aspect in zip(views, (WIDE, TALL), strict=True):
            look_at(camera, self._drawn.bounds, aspect)
        given = {"views": [vars(camera) for camera in views], "told": self._told,
                 "title": html.escape(self._title), "key": legend(self.moments)}  # fmt: skip
        text = json.dumps(given, ensure_ascii=False).replace("</", "<\\/")
        return WORDS.read_text().replace("GIVEN", text, 1)


def _taped() -> tuple[Any, Any]:
    """viser's recorder and scene, without the server that they come with."""
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
    return tape, scene
