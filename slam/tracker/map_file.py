# SPDX-License-Identifier: Apache-2.0
"""A SLAM's memory as a file: its config, the living cells, and where the robot was.

A NumPy archive (.npz) without pickled objects. ``header`` is JSON text with ``format``, ``version``
and ``state``; ``places`` (n, 2) are the blocks' indices (x, y); ``x``, ``y``, ``age`` and
``facing`` (n, 8, 8) their cells. The header's ``sha256`` is the sum of all the rest; maps of
before it have none, which is said in the log. Older readers refuse newer versions.

Version 2 has more arrays, which the header names as ``extra``: what a package above keeps beside
the map. A map without any is written as version 1, and one of version 1 is read as one without.
"""

import dataclasses
import hashlib
import json
import logging
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from slam.archives import read_arrays, write_arrays
from slam.arrays import Float
from slam.checked import covariance, is_number, pose
from slam.errors import InvalidValueError, LogFormatError
from slam.files import replacing
from slam.tracker.cell_map import CellMap
from slam.tracker.cells import FREE_COUNT, MOST_OFF, SIDE, living
from slam.tracker.config import TrackerConfig

# Numbers that trackers no longer have, of maps that were saved while they had them.
_GONE: dict[str, tuple[str, ...]] = {
    "": ("range_error",),
    "features": ("corners",),
    "frontend": ("surfaces", "view", "prior", "spacing_m", "least_weight"),
    "tracking": ("quality", "verdict"),
    "belief": (
        "alike", "broken", "breaks", "changed_per_m", "confirmed", "confirmed_m",
        "confirmed_share", "corrected", "goes_on", "linear_m", "nearby_per_m", "outdated", "place",
        "pulled_m", "pulled_rad", "searched", "slip_m", "slip_rad", "slips_per_m", "through",
        "through_per_m", "unsearched", "vanished",
    ),
    "matching.budget": ("weigh_ns",),
    "matching.usual": ("fallen", "odd", "outvoted"),
    "standing": (
        "alert_m", "better", "doubtful_m", "explains", "fallen", "fallen_s", "long_window_s",
        "outvoted", "rival_gain", "rival_m", "rival_points", "rival_rad", "rival_s", "rival_scans",
        "undecided_s",
    ),
    "tracking.relocalise": (
        "alias", "alone", "denied_here", "drift_m", "drift_rad", "enough", "enough_last",
        "enough_later", "farthest_m", "farthest_rad", "few_vote", "hopeless", "kept", "last",
        "later", "on_m", "on_rad", "on_s", "pushed_mps", "pushed_radps", "scans", "slipped_m",
        "slipped_rad", "sure",
    ),
}  # fmt: skip

_LEFT = {"frontend.bias": ("per_m", "per_rad")}  # all others are gone


def updated(words: Any) -> Any:
    """The tree of a config as it would be saved today; what is no tree is given back as it is.

    Of ``freeze_below`` only 0 has a meaning today: a pose that is never doubted.
    """
    if not isinstance(words, Mapping):
        return words
    found = _without(words, "")
    if "freeze_below" in found:
        freeze_below = found.pop("freeze_below")
        if freeze_below == 0.0:
            found.setdefault("carried_per_h", 0.0)
    return found


def _without(words: Mapping[str, Any], path: str) -> dict[str, Any]:
    gone = _GONE.get(path, ())
    return {
        name: _without(value, f"{path}.{name}".lstrip(".")) if isinstance(value, Mapping) else value
        for name, value in words.items()
        if name not in gone and name in _LEFT.get(path, words)
    }


FORMAT, VERSION = "mobilia shunting memory", 2
PLAIN = 1  # version of a map without extra arrays
FORMER = ("supports", "tracked_s", "tracked")  # of a state, no longer asked
Config = TypeVar("Config", bound=TrackerConfig)
_ARRAYS = ("places", "x", "y", "age", "facing")
_WORDS = {"format", "version", "config", "config_sha256", "state", "sha256"}
_EXTRA = re.compile(r"[a-z]{1,20}_[a-z_]{1,40}")
MOST_EXTRA = 20  # arrays
# What a file may claim.
MAX_BYTES = 1 << 30  # of all arrays: 1.2 million blocks, 70 000 m^2 of cells of 3 cm
FARTHEST = 1 << 20  # blocks from the origin: 250 km
MOST_AGE_S = 1.5e8  # 13 times the slowest pace, two minutes a scan
MOST_ODDS = 3.5  # as in ``slam.grid.occupancy``
MOST_POSE = 1e6  # m and rad, and standard deviations
MOST_VALUES, MOST_COUNT = 10_000, 1e12
_log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True, eq=False)
class State:
    """What a SLAM must know beside its network to go on.

    kind         which SLAM wrote the map: "ShuntingSlam", "OccupancySlam", ...
    T_map_robot  (3,) where the robot was, and its (3, 3) covariance
    usual        latest matched fractions
    """

    kind: str
    T_map_robot: Float
    covariance: Float
    usual: tuple[float, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_map_robot", pose("State", "T_map_robot", self.T_map_robot))
        object.__setattr__(self, "covariance", covariance("State", "covariance", self.covariance))
        if not isinstance(self.kind, str):
            raise InvalidValueError(f"State.kind must be a word, got {self.kind!r:.40}")
        if max(map(abs, self.T_map_robot.tolist())) > MOST_POSE:
            raise InvalidValueError(f"State.T_map_robot must lie within {MOST_POSE:g} m and rad")
        if self.covariance.max() > MOST_POSE**2:
            raise InvalidValueError(f"State.covariance must lie within {MOST_POSE:g}^2")
        if not isinstance(self.usual, (list, tuple)) or len(self.usual) > MOST_VALUES:
            raise InvalidValueError(f"State.usual must be up to {MOST_VALUES} numbers")
        for value in self.usual:
            _positive("usual", value, (int, float))


def _positive(name: str, value: object, kinds: tuple[type, ...]) -> None:
    """Raise ``InvalidValueError`` unless it is a number from 0 to ``MOST_COUNT``."""
    if not is_number(value, kinds) or not 0.0 <= value <= MOST_COUNT:
        raise InvalidValueError(
            f"State.{name} must be a number in [0, {MOST_COUNT:g}], got {value!r:.40}"
        )


def save(
    path: Path,
    cell_map: CellMap,
    state: State,
    extra: Mapping[str, NDArray[Any]] | None = None,
) -> None:
    """Write all; the file appears whole or not at all. Raises ``OutputError``.

    ``extra`` arrays have names such as ``day_cells``.
    """
    extra = extra or {}
    slots, places = living(cell_map.cells)
    header: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION if extra else PLAIN,
        "config": cell_map.config.as_words(),
        "config_sha256": cell_map.config.sha256(),
        "state": dataclasses.asdict(state)
        | {"T_map_robot": state.T_map_robot.tolist(), "covariance": state.covariance.tolist()},
    }
    cells = cell_map.cells
    arrays: dict[str, NDArray[Any]] = {
        "places": places,
        "x": cells.x[slots],
        "y": cells.y[slots],
        "age": cell_map.kept(slots),
        "facing": cells.facing[slots],
    }
    if extra:
        header["extra"] = sorted(extra)
        arrays |= extra
    header["sha256"] = _sum(header, arrays)
    with replacing(path) as temporary, temporary.open("wb") as file:
        write_arrays(file, {"header": np.array(json.dumps(header)), **arrays})


def _sum(header: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> str:
    """Of the header but its own entry, and of all arrays."""
    rest = {name: value for name, value in header.items() if name != "sha256"}
    found = hashlib.sha256(json.dumps(rest, sort_keys=True).encode())
    for name in (*_ARRAYS, *header.get("extra", ())):
        array = np.ascontiguousarray(arrays[name])
        found.update(f"{name} {array.dtype.str} {array.shape}".encode())
        found.update(array.tobytes())
    return found.hexdigest()


def check(path: Path) -> None:
    """Raise ``LogFormatError`` for a file that is not whole, whatever SLAM wrote it."""
    _whole(path)


def read(path: Path, kind: type[Config]) -> tuple[Config, State, dict[str, NDArray[Any]]]:
    """Config of that ``kind``, state and arrays of a file that ``save`` wrote.

    Raises ``LogFormatError`` for a file that is missing, cut short, damaged, of another kind, of a
    newer version, or that claims more than a map can have (``MAX_BYTES``, checked before anything
    is unpacked).
    """
    header, state, arrays = _whole(path)
    try:
        config = kind.from_words(updated(header["config"]))
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise LogFormatError(path, f"damaged {FORMAT}: {error}") from error
    return config, state, arrays


def _whole(path: Path) -> tuple[dict[str, Any], State, dict[str, NDArray[Any]]]:
    header = _header(path, read_arrays(path, ("header",), max_bytes=MAX_BYTES)["header"])
    arrays = read_arrays(path, (*_ARRAYS, *header.get("extra", ())), max_bytes=MAX_BYTES)
    _check(path, arrays)
    if "sha256" not in header:
        _log.warning("%s: a map of before sums; damage to it would not be noticed", path)
    elif header["sha256"] != _sum(header, arrays):
        raise LogFormatError(path, f"damaged {FORMAT}: its content is not what was written")
    try:
        words = header["state"].items()
        state = State(**{name: value for name, value in words if name not in FORMER})
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise LogFormatError(path, f"damaged {FORMAT}: {error}") from error
    _check_ages(path, arrays["age"], state.kind)
    return header, state, arrays


def _header(path: Path, text: NDArray[Any]) -> dict[str, Any]:
    """The words; a number in them that is NaN or infinite is no JSON."""

    def refuse(word: str) -> None:
        raise ValueError(f"{word} is no number")

    try:
        header = json.loads(str(text), parse_constant=refuse)
    except (ValueError, RecursionError) as error:
        raise LogFormatError(path, f"not a whole {FORMAT}: its header: {error}") from error
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise LogFormatError(path, f"not a {FORMAT}")
    version = header.get("version")
    if isinstance(version, bool) or version not in (PLAIN, VERSION):
        raise LogFormatError(
            path, f"version {version!r} of a {FORMAT}; {PLAIN} and {VERSION} are known"
        )
    unknown = sorted(set(header) - _WORDS - ({"extra"} if version == VERSION else set()))
    if unknown:
        raise LogFormatError(path, f"damaged {FORMAT}: its header has {unknown[0][:40]!r}")
    _check_extra(path, header.get("extra", []), version)
    return header


def _check_extra(path: Path, names: object, version: int) -> None:
    """Names of arrays, each once, none of them one of the map's own."""
    good = isinstance(names, list) and bool(names) == (version == VERSION)
    if not good or not all(isinstance(n, str) and _EXTRA.fullmatch(n) for n in names):  # type: ignore[attr-defined]
        raise LogFormatError(path, f"damaged {FORMAT}: extra must name arrays, got {names!r:.60}")
    assert isinstance(names, Sequence)
    if len(set(names)) != len(names) or len(names) > MOST_EXTRA:
        raise LogFormatError(
            path, f"damaged {FORMAT}: extra must name up to {MOST_EXTRA} arrays, each once"
        )


def read_extra(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays that lie beside the map, none in a map of version 1; raises as ``check`` does.

    Their shapes and values are for the reader to check.
    """
    header, _, arrays = _whole(path)
    return {name: arrays[name] for name in header.get("extra", ())}


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
    for name in ("x", "y"):
        if n and not 0.0 <= arrays[name].min() <= arrays[name].max() <= 1.0:
            raise LogFormatError(path, f"{name} must lie in [0, 1]")
    places = arrays["places"]
    if n and (places.min() <= -FARTHEST or places.max() >= FARTHEST):
        raise LogFormatError(path, f"places must lie within {FARTHEST} blocks")
    if len(np.unique(places, axis=0)) != n:
        raise LogFormatError(path, "places: a block occurs twice")


def _check_ages(path: Path, ages: NDArray[Any], kind: str) -> None:
    """Seconds of looking; of an ordinary grid, log-odds."""
    least = -MOST_ODDS if kind == "OccupancySlam" else 0.0
    most = MOST_ODDS if kind == "OccupancySlam" else MOST_AGE_S
    if ages.size and not least <= ages.min() <= ages.max() <= most:
        raise LogFormatError(path, f"age must lie in [{least:g}, {most:g}] in a map of {kind}")


def fill(cell_map: CellMap, arrays: dict[str, NDArray[Any]]) -> None:
    """Let the blocks of a file live in an empty ``cell_map``."""
    places = arrays["places"]
    if len(places) == 0:
        return
    size = SIDE * cell_map.cell
    low, high = places.min(axis=0) * size, (places.max(axis=0) + 1) * size
    cell_map.cover(float(low[0]), float(low[1]), float(high[0]), float(high[1]))
    for k, (column, row) in enumerate((places - cell_map.cells.corner).tolist()):
        if cell_map.cells.counts[FREE_COUNT] == 0:
            cell_map.grow()
        cells = cell_map.cells
        cells.counts[FREE_COUNT] -= 1
        slot = int(cells.free[cells.counts[FREE_COUNT]])
        cells.directory[row, column] = slot
        cells.x[slot], cells.y[slot] = arrays["x"][k], arrays["y"][k]
        cells.facing[slot] = arrays["facing"][k]
        cells.off[slot] = MOST_OFF
        cell_map.restore(slot, arrays["age"][k])
