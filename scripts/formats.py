# SPDX-License-Identifier: Apache-2.0
"""What an episode can be written as: a row for ``export --to`` and ``generate --format`` alike.

The function of the same name in ``scripts.exports`` writes it.
"""

from dataclasses import dataclass
from pathlib import Path

from sim.recording import MINARI
from slam.errors import InvalidValueError, needed

BAG = "mcap"
_EXTRA = "data"


@dataclass(frozen=True)
class Format:
    """suffix  of its files; packages  of the extra ``data`` that it needs."""

    suffix: str
    packages: tuple[str, ...] = ()


FORMATS = {
    BAG: Format(".mcap"), "db3": Format(".db3"), "parquet": Format(".parquet", ("pyarrow",)),
    "npz": Format(".npz"), "carmen": Format(".log.gz"), "tum": Format(".tum"),
    MINARI: Format("", ("pyarrow", "minari")),
}  # fmt: skip


def ready(name: str, *, recorded: bool = True) -> Format:
    """The row, before the work begins: ``MissingDependencyError`` where a package is not there.

    recorded  whether it is to be made of a recording: ``InvalidValueError`` where it cannot be
    """
    if recorded and name == MINARI:
        raise InvalidValueError(
            "--to minari needs actions, which a recording has none of: "
            "mobilia generate SCENE --format minari"
        )
    for package in FORMATS[name].packages:
        needed(package, package, _EXTRA)
    return FORMATS[name]


def write_beside(name: str, episode: Path) -> None:
    """An episode in that format, too, in its own folder."""
    from scripts.exports import Source, write

    write(name, episode / f"{episode.name}{FORMATS[name].suffix}", Source(episode))
