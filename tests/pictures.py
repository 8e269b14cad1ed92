# SPDX-License-Identifier: Apache-2.0
"""Pictures of a film without the film."""

from collections.abc import Sequence

from scripts.film.render import Snapshots, shoot
from scripts.film.show import Show
from sim.view.draw import Picture
from slam.frames import Stream


def pictures_at(
    stream: Stream, show: Show, seconds: Sequence[float], *, whole: bool = False
) -> list[Picture]:
    """Of a run at these moments, for ``scripts.film.render``.

    Scan above map each (``Show.vignette``); ``whole``: all of the film frame.
    """
    snapshots = Snapshots(show, seconds, show.paint if whole else show.vignette)
    for frame in shoot(stream, show, None):
        snapshots.note(frame)
        if snapshots.done():
            break
    return snapshots.finish()
