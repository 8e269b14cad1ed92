# SPDX-License-Identifier: Apache-2.0
"""Seeds that nobody can tune on: their hash is published first, they are when all SLAMs are in.

Who holds the board draws them and keeps the file. Who sends a SLAM sees the hash only. When the
file is published, anyone can run the SLAMs on its seeds, and see that they are the ones promised.
"""

import hashlib
import json
import os
import re
import secrets
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from scripts.benchmark.submission import MAX_SEED, MAX_SEEDS, SEALED, SEEDS
from scripts.benchmark.tracks import FRESH, TEST, TRAIN, Track, check_known, newest
from scripts.comparison.rules import check_keys
from scripts.result_files import load
from sim.core.versions import WORLD, world_of
from slam.errors import InvalidValueError, LogFormatError, OutputError

WHAT = "sealed seeds of the benchmark of mobilia"
_SALT_BYTES = 32  # without it, the few seeds could be found from their hash
_SALT = re.compile(r"[0-9a-f]{64}")
_KEYS = {"what", "world", "tracks", "salt", SEALED}


@dataclass(frozen=True, kw_only=True)
class SealedSeeds:
    """Seeds of some tracks, and the words that hide them in their hash.

    world, tracks  what they are for: a version of the world, and by name the hashes of its tracks
    """

    seeds: tuple[int, ...]
    salt: str
    world: int = WORLD
    tracks: Mapping[str, str] = field(
        default_factory=lambda: {track.name: track.sha256 for track in newest().values()}
    )

    def check_for(self, tracks: Iterable[Track]) -> None:
        """Raise ``InvalidValueError`` for a track that these seeds were not sealed for."""
        for track in tracks:
            if track.name not in self.tracks:
                raise InvalidValueError(f"the sealed seeds are not for track {track.name}")

    def data(self) -> dict[str, Any]:
        """What the file holds."""
        return {
            "what": WHAT, "world": self.world, "tracks": dict(self.tracks), "salt": self.salt,
            SEALED: list(self.seeds),
        }  # fmt: skip

    @property
    def sha256(self) -> str:
        """The seal: what is published first."""
        return hashlib.sha256(json.dumps(self.data(), sort_keys=True).encode()).hexdigest()


def drawn(count: int) -> SealedSeeds:
    """So many, by chance that cannot be repeated; none that is published already."""
    if not 1 <= count <= MAX_SEEDS:
        raise InvalidValueError(f"--seeds must be 1 to {MAX_SEEDS}, got {count}")
    known, seeds = {*TRAIN, *TEST, *FRESH}, list[int]()
    while len(seeds) < count:
        seed = secrets.randbelow(MAX_SEED + 1)
        if seed not in known:
            known.add(seed)
            seeds.append(seed)
    return SealedSeeds(seeds=tuple(seeds), salt=secrets.token_hex(_SALT_BYTES))


def write(path: Path, sealed: SealedSeeds) -> None:
    """A new file that others cannot read.

    Raises ``InvalidValueError`` where there is one, as its seal may be published, ``OutputError``.
    """
    try:
        number = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except FileExistsError as error:
        raise InvalidValueError(f"{path} exists: its seal may be published") from error
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror}") from error
    with open(number, "w", encoding="utf-8") as file:
        file.write(json.dumps(sealed.data(), indent=1) + "\n")


def read(path: Path) -> SealedSeeds:
    """Inverse of ``write``.

    Raises ``LogFormatError`` for something else, or for other tracks, ``WorldVersionError`` for
    those of a newer world.
    """
    data = load(path, WHAT, None)
    if data.get("what") != WHAT or set(data) != _KEYS:
        raise LogFormatError(path, f"no {WHAT}")
    world, tracks = world_of(path, data), data["tracks"]
    if not isinstance(tracks, dict) or not tracks:
        raise LogFormatError(
            path, f"tracks must be one or more with their hashes, got {tracks!r:.80}"
        )
    check_known(path, world, tracks)
    seeds, salt = data[SEALED], data["salt"]
    check_keys(path, "", data, {SEALED: SEEDS})
    if len({*seeds}) < len(seeds) or {*TRAIN, *TEST, *FRESH} & set(seeds):
        raise LogFormatError(path, "seeds must be each once, and none that is published")
    if not isinstance(salt, str) or not _SALT.fullmatch(salt):
        raise LogFormatError(path, "salt must be 64 hexadecimal digits")
    return SealedSeeds(seeds=tuple(seeds), salt=salt, world=world, tracks=tracks)
