# SPDX-License-Identifier: Apache-2.0
"""H.264 films without a window: pictures are composed as arrays and piped to ffmpeg."""

import math
import re
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import imageio_ffmpeg
import numpy as np

from scripts.film import FPS
from sim.view.draw import Picture
from slam.errors import InvalidValueError, MissingDependencyError, OutputError
from slam.files import reason, replacing
from slam.shaped import within

Size = tuple[int, int]

SIZE: Size = (1280, 720)
FILM_S = 60.0  # a longer run is shown faster, unless a speed is asked for
MOST_SPEED = 1e4
LAPSE_FPS = 10.0  # of the film of a long log
SCANS_A_PICTURE = 15  # 20 ms a picture; a scan costs the SLAM 4 ms in a street, 13 ms in rooms
LEAST_PICTURES, MOST_PICTURES = 60, 600
CRF = 21  # H.264's constant rate factor: hardly a loss to see
# x264's presets: at the same CRF, a picture of the second costs half and takes twice the bytes.
PRESET, LAPSE_PRESET = "veryfast", "ultrafast"
_SIZES = (320, 4096)


def require_ffmpeg() -> None:
    """Raise ``MissingDependencyError`` with a remedy when no ffmpeg can be found."""
    try:
        imageio_ffmpeg.get_ffmpeg_version()  # runs it
    except (RuntimeError, OSError, subprocess.SubprocessError, IndexError) as error:
        raise MissingDependencyError(
            "no ffmpeg was found to write the film: install one (pip install imageio-ffmpeg brings "
            "its own) or set IMAGEIO_FFMPEG_EXE, or pass --no-film"
        ) from error


def size_of(words: str) -> Size:
    """``1280x720`` as (width, height); even numbers, as H.264 wants them."""
    found = re.fullmatch(r"(\d{1,5})x(\d{1,5})", words.strip())
    if found is None:
        raise InvalidValueError(f"--size must be WIDTHxHEIGHT such as 1280x720, got '{words}'")
    width, height = int(found[1]), int(found[2])
    low, high = _SIZES
    if not (low <= width <= high and low // 2 <= height <= high) or width % 2 or height % 2:
        raise InvalidValueError(
            f"--size must be even numbers from {low}x{low // 2} to {high}x{high}, got {words}"
        )
    return width, height


@dataclass(frozen=True, kw_only=True)
class Pace:
    """Which moments of a run become pictures.

    fps     pictures per second of film
    speed   seconds of the run per second of film
    from_s, to_s  the part that is shown, s since the first frame
    preset  of the encoder
    """

    fps: float = FPS
    speed: float = 1.0
    from_s: float = 0.0
    to_s: float = math.inf
    preset: str = PRESET

    def __post_init__(self) -> None:
        within("fps", self.fps, 1.0, 240.0)
        within("speed", self.speed, 0.01, MOST_SPEED)
        if not 0.0 <= self.from_s < self.to_s:
            raise InvalidValueError(
                f"a film must go from 0 s or later to a later moment, got {self.from_s} to "
                f"{self.to_s} s"
            )

    @classmethod
    def within_a_minute(cls, duration_s: float, fps: float = FPS) -> "Pace":
        """Real time, faster where the film would last longer than ``FILM_S``."""
        return cls(fps=fps, speed=max(1.0, duration_s / FILM_S))

    @classmethod
    def of_log(cls, duration_s: float, scans: int) -> "Pace":
        """Real time up to a minute, no picture oftener than scans; longer logs in time-lapse.

        One picture for ``SCANS_A_PICTURE`` scans, at most ``MOST_PICTURES``: it costs less than
        these cost the SLAM.
        """
        rate = scans / duration_s if duration_s > 0.0 else FPS
        if duration_s <= FILM_S:
            return cls(fps=min(max(rate, LAPSE_FPS), FPS))
        pictures = min(max(scans // SCANS_A_PICTURE, LEAST_PICTURES), MOST_PICTURES)
        speed = duration_s * LAPSE_FPS / pictures
        return cls(fps=LAPSE_FPS, speed=min(max(speed, 1.0), MOST_SPEED), preset=LAPSE_PRESET)

    def due(self, seconds: float) -> int:
        """How many pictures the film has up to a moment of the run."""
        if seconds < self.from_s:
            return 0
        shown = min(seconds, self.to_s) - self.from_s
        return math.floor(shown * self.fps / self.speed + 1e-6) + 1


@contextmanager
def film(path: Path, fps: float, *, crf: int = CRF, preset: str = PRESET) -> "Iterator[Film]":
    """A film that appears under ``path`` when the block ends well, and not at all otherwise.

    crf     H.264's constant rate factor: more is coarser and smaller
    preset  of x264: how hard it looks for a smaller file

    Raises ``OutputError`` when ffmpeg stops or ends badly (disk full, say), or got no picture.
    """
    require_ffmpeg()
    with replacing(path) as temporary:
        reel = Film(temporary, path, fps, crf, preset)
        try:
            yield reel
            reel.finish()
        finally:
            reel.stop()


class Film:
    """Takes (height, width, 3) uint8 pictures of one size, one at a time.

    imageio's own writer does not tell how ffmpeg ended: a film cut short would pass for a whole one
    """

    def __init__(
        self, temporary: Path, path: Path, fps: float, crf: int = CRF, preset: str = PRESET
    ) -> None:
        self.frames = 0
        self.last: Picture | None = None
        self._temporary, self._path = temporary, path
        self._fps, self._crf, self._preset = fps, crf, preset
        self._ffmpeg: subprocess.Popen[bytes] | None = None

    def add(self, picture: Picture) -> None:
        """Append one picture; raises ``OutputError`` when ffmpeg stops (disk full, say)."""
        if self._ffmpeg is None:
            self._ffmpeg = self._start(picture.shape[1], picture.shape[0])
        assert self._ffmpeg.stdin is not None
        try:
            self._ffmpeg.stdin.write(np.ascontiguousarray(picture).data)
        except OSError as error:
            raise self._failure(error) from error
        self.frames += 1
        self.last = picture

    def finish(self) -> None:
        """Wait until ffmpeg has written all of it."""
        if self._ffmpeg is None:
            raise OutputError(f"cannot write {self._path}: a film needs a picture")
        assert self._ffmpeg.stdin is not None
        try:
            self._ffmpeg.stdin.close()
        except OSError as error:
            raise self._failure(error) from error
        if self._ffmpeg.wait() != 0:
            raise self._failure(OSError(f"exit status {self._ffmpeg.returncode}"))

    def stop(self) -> None:
        """End ffmpeg if it still runs."""
        if self._ffmpeg is None:
            return
        self._ffmpeg.kill()
        assert self._ffmpeg.stdin is not None
        with suppress(OSError):
            self._ffmpeg.stdin.close()
        self._ffmpeg.wait()

    def _failure(self, error: OSError) -> OutputError:
        why = reason(error, self._path.parent)
        return OutputError(f"cannot write {self._path}: {why} (ffmpeg stopped)")

    def _start(self, width: int, height: int) -> subprocess.Popen[bytes]:
        command = [
            imageio_ffmpeg.get_ffmpeg_exe(), "-y", "-v", "quiet",
            "-f", "rawvideo", "-vcodec", "rawvideo", "-s", f"{width}x{height}",
            "-pix_fmt", "rgb24", "-r", f"{self._fps:.02f}", "-i", "-", "-an",
            "-vcodec", "libx264", "-pix_fmt", "yuv420p", "-preset", self._preset,
            "-crf", str(self._crf), "-threads", "1",  # the same bytes on any number of cores
            "-movflags", "+faststart", str(self._temporary),
        ]  # fmt: skip
        return subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            process_group=0,  # Ctrl-C is ours to handle
        )
