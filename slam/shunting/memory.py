# SPDX-License-Identifier: Apache-2.0
"""A SLAM's memory as a file: its knobs, the living neurons, and where the robot was.

A NumPy archive (.npz) without pickled objects. ``header`` is JSON text with ``format``, ``version``
and ``state``; ``places`` (n, 2) are the blocks' indices (x, y); ``x``, ``y``, ``age`` and
``facing`` (n, 8, 8) their neurons. Older readers refuse newer versions.
"""

from __future__ import annotations

import dataclasses
import json
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slam.checked import covariance, pose
from slam.errors import InvalidValueError, LogFormatError
from slam.files import replacing
from slam.frames import Float
from slam.shunting.cells import FREE_COUNT, SIDE, living
from slam.shunting.config import ShuntingConfig
from slam.shunting.network import Network

FORMAT, VERSION = "mobilia shunting memory", 1
_ARRAYS = ("places", "x", "y", "age", "facing")


@dataclass(frozen=True, kw_only=True, eq=False)
class State:
    """What a SLAM must know beside its network to go on.

    kind         which SLAM wrote the map: "ShuntingSlam", "OccupancySlam", ...
    T_map_robot  (3,) where the robot was, and its (3, 3) covariance
    usual        latest matched fractions; ``supports`` the same times the confirmed map
    tracked_s    s of tracking on this map, and in how many scans
    """

    kind: str
    T_map_robot: Float
    covariance: Float
    usual: tuple[float, ...]
    supports: tuple[float, ...]
    tracked_s: float
    tracked: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_map_robot", pose("State", "T_map_robot", self.T_map_robot))
        object.__setattr__(self, "covariance", covariance("State", "covariance", self.covariance))


def save(path: Path, network: Network, state: State) -> None:
    """Write both; the file appears whole or not at all. Raises ``OutputError``."""
    slots, places = living(network.cells)
    header = {
        "format": FORMAT,
        "version": VERSION,
        "config": dataclasses.asdict(network.config),
        "state": dataclasses.asdict(state)
        | {"T_map_robot": state.T_map_robot.tolist(), "covariance": state.covariance.tolist()},
    }
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(
            file,
            header=np.array(json.dumps(header)),
            places=places,
            x=network.cells.x[slots],
            y=network.cells.y[slots],
            age=network.cells.age[slots],
            facing=network.cells.facing[slots],
        )


def read(path: Path) -> tuple[ShuntingConfig, State, dict[str, NDArray[Any]]]:
    """Knobs, state and arrays of a file that ``save`` wrote.

    Raises ``LogFormatError`` for a file that is missing, cut short, damaged, of another kind or of
    a newer version.
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            header = json.loads(str(archive["header"]))
            if not isinstance(header, dict) or header.get("format") != FORMAT:
                raise LogFormatError(path, f"not a {FORMAT}")
            if header.get("version") != VERSION:
                raise LogFormatError(
                    path, f"version {header.get('version')!r} of a {FORMAT}; {VERSION} is known"
                )
            arrays = {name: archive[name] for name in _ARRAYS}
        config, state = ShuntingConfig(**header["config"]), State(**header["state"])
    except FileNotFoundError as error:
        raise LogFormatError(path, "cannot be read: no such file") from error
    except (OSError, EOFError, KeyError, TypeError, ValueError, AttributeError) as error:
        raise LogFormatError(path, f"not a whole {FORMAT}: {error}") from error
    except (zipfile.BadZipFile, zlib.error, InvalidValueError) as error:
        raise LogFormatError(path, f"damaged {FORMAT}: {error}") from error
    _check(path, arrays)
    return config, state, arrays


def _check(path: Path, arrays: dict[str, NDArray[Any]]) -> None:
    n = len(arrays["places"]) if arrays["places"].ndim else 0
    for name, shape, kind in (
        ("places", (n, 2), np.int64),
        ("x", (n, SIDE, SIDE), np.float32),
        ("y", (n, SIDE, SIDE), np.float32),
        ("age", (n, SIDE, SIDE), np.float32),
        ("facing", (n, SIDE, SIDE), np.uint8),
    ):
        array = arrays[name]
        if array.shape != shape or array.dtype != kind or not np.isfinite(array).all():
            raise LogFormatError(path, f"{name} must be finite {kind.__name__} of shape {shape}")
    if len(np.unique(arrays["places"], axis=0)) != n:
        raise LogFormatError(path, "places: a block occurs twice")


def fill(network: Network, arrays: dict[str, NDArray[Any]]) -> None:
    """Let the blocks of a file live in an empty ``network``."""
    places = arrays["places"]
    if len(places) == 0:
        return
    size = SIDE * network.cell
    low, high = places.min(axis=0) * size, (places.max(axis=0) + 1) * size
    network.cover(float(low[0]), float(low[1]), float(high[0]), float(high[1]))
    for k, (column, row) in enumerate((places - network.cells.corner).tolist()):
        if network.cells.counts[FREE_COUNT] == 0:
            network.grow()
        cells = network.cells
        cells.counts[FREE_COUNT] -= 1
        slot = int(cells.free[cells.counts[FREE_COUNT]])
        cells.directory[row, column] = slot
        cells.x[slot], cells.y[slot] = arrays["x"][k], arrays["y"][k]
        cells.age[slot], cells.facing[slot] = arrays["age"][k], arrays["facing"][k]
