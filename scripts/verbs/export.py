# SPDX-License-Identifier: Apache-2.0
"""``mobilia export``: an episode, or any bag, in the formats of others."""

from pathlib import Path

from rich.markup import escape

from scripts.console import say, working
from scripts.formats import FORMATS, ready
from scripts.names import run_name
from scripts.spec import REQUIRED, argument, names_of, option, spec


@spec
class Export:
    """Write an episode, a bag or any other log in the format of others.

    mcap, db3: the very messages of a bag of ROS 2, packed as MCAP or as SQLite. parquet (extra
    `data`): a row a scan, ranges and labels as lists of fixed size. npz: the same as arrays by
    name. carmen: scans, odometry, true poses. tum: NAME_odometry.tum and, where it is known,
    NAME_truth.tum. minari is of `generate --format`.
    """

    episode: Path = argument("An episode, a bag or any other log.", REQUIRED)
    to: str = option(
        f"{', '.join(FORMATS)}.", REQUIRED, choices=tuple(FORMATS), metavar="FORMAT",
        complete=names_of("scripts.formats:FORMATS"),
    )  # fmt: skip
    out: Path | None = option(
        "File to write; default beside the log or dataset. tum: NAME_odometry.tum, ...",
        writes="file",
    )

    def __call__(self) -> None:
        suffix = ready(self.to).suffix
        from scripts.exports import Source, write
        from sim.recording.verify import check_bag

        check_bag(self.episode)
        plain = self.episode.absolute()
        name = plain.name if plain.is_dir() else run_name(plain)
        target = self.out or _beside(plain) / (name + suffix)
        with working(f"writing {self.to}"):
            written = write(self.to, target, Source(self.episode))
        for path in written:
            say(escape(str(path)))


def _beside(log: Path) -> Path:
    """The nearest folder above whose files no SHA256SUMS lists: there, one more is no damage."""
    from sim.recording.sums import SUMS

    free = (folder for folder in log.parents if not (folder / SUMS).exists())
    return next(free, log.parent)
