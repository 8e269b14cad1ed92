# SPDX-License-Identifier: Apache-2.0
"""Seeds that nobody can tune on: their hash is published first, they are when all SLAMs are in.

Who holds the board draws them and keeps the file. Who sends a SLAM sees the hash only. When the
file is published, anyone can run the SLAMs on its seeds, and see that they are the ones promised.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import secrets
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scripts.benchmark.submission import MAX_SEED, MAX_SEEDS, SEALED
from scripts.benchmark.tracks import TEST, TRACKS, TRAIN
from sim.core.versions import WORLD, check_world, world_of
from slam.bounded import text_of
from slam.errors import InvalidValueError, LogFormatError, OutputError

WHAT = "sealed seeds of the benchmark of mobilia"
MAX_BYTES = 1 << 20
_SALT_BYTES = 32  # without it, the few seeds could be found from their hash
_SALT = re.compile(r"[0-9a-f]{64}")
_KEYS = {"what", "world", "tracks", "salt", SEALED}


@dataclass(frozen=True, kw_only=True)
class SealedSeeds:
    """Seeds of every track, and the words that hide them in their hash."""

    seeds: tuple[int, ...]
    salt: str

    def data(self) -> dict[str, Any]:
        """What the file holds: the tracks and the world they are for, too."""
        tracks = {name: track.sha256 for name, track in TRACKS.items()}
        return {
            "what": WHAT, "world": WORLD, "tracks": tracks, "salt": self.salt,
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
    known, seeds = {*TRAIN, *TEST}, list[int]()
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
    those of another world.
    """
    try:
        data = json.loads(text_of(path, MAX_BYTES))
    except (ValueError, RecursionError) as error:
        raise LogFormatError(path, f"no {WHAT}: {error}") from error
    if not isinstance(data, dict) or data.get("what") != WHAT or set(data) != _KEYS:
        raise LogFormatError(path, f"no {WHAT}")
    check_world(path, world_of(path, data))
    seeds, salt = data[SEALED], data["salt"]
    known = isinstance(seeds, list) and 0 < len(seeds) <= MAX_SEEDS
    if not known or not all(type(seed) is int and 0 <= seed <= MAX_SEED for seed in seeds):
        raise LogFormatError(path, f"seeds must be whole numbers, 0 to {MAX_SEED}")
    if len(set(seeds)) < len(seeds) or {*TRAIN, *TEST} & set(seeds):
        raise LogFormatError(path, "seeds must be each once, and none that is published")
    if not isinstance(salt, str) or not _SALT.fullmatch(salt):
        raise LogFormatError(path, "salt must be 64 hexadecimal digits")
    sealed = SealedSeeds(seeds=tuple(seeds), salt=salt)
    if data["tracks"] != sealed.data()["tracks"]:
        raise LogFormatError(path, "its tracks are others than those of this version")
    return sealed
