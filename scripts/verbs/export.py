# SPDX-License-Identifier: Apache-2.0
"""``mobilia export``: an episode, or any bag, in the formats of others."""

from pathlib import Path

from rich.markup import escape

from scripts.console import say, working
from scripts.names import check
from scripts.spec import REQUIRED, SLAMS, argument, option, spec
from slam.errors import InvalidValueError

SLAM = "shunting"
SUFFIXES = {"tum": ".tum", "carmen": ".log.gz", "npz": ".npz", "smfeval": ".tum"}


@spec
class Export:
    """Write an episode as TUM trajectories, as a CARMEN log or as NumPy arrays.

    tum: NAME_odometry.tum and, where it is known, NAME_truth.tum. carmen: scans, odometry, true
    poses. npz: everything, labels too, as arrays by name. smfeval: runs a SLAM; NAME_SLAM.tum has
    its online poses with their covariances ("wide TUM"), NAME_truth.tum the true ones in its map.
    """

    episode: Path = argument("An episode, a bag or any other log.", REQUIRED)
    to: str = option("tum, carmen, npz or smfeval.", REQUIRED, choices=tuple(SUFFIXES))
    out: Path | None = option(
        "File to write; default beside the log or dataset. tum: NAME_odometry.tum, ...",
        writes="file",
    )
    slam: str = option("With --to smfeval: whose poses.", SLAM, complete=SLAMS)

    def __call__(self) -> None:
        if self.slam != SLAM and self.to != "smfeval":
            raise InvalidValueError(f"--slam is for --to smfeval, got --to {self.to}")
        check([self.slam])
        from scripts import exports
        from sim.recording.verify import check_bag
        from slam.logs import open_log, read_bag
        from slam.logs.bag_topics import is_bag

        check_bag(self.episode)
        bag = is_bag(self.episode)
        stream = read_bag(self.episode, labels=True) if bag else open_log(self.episode)
        plain = self.episode.absolute()
        target = self.out or _beside(plain) / (plain.name.split(".log")[0] + SUFFIXES[self.to])
        with working(f"writing {self.to}"):
            written = exports.WRITERS[self.to](target, stream, self.slam)
        for path in written:
            say(escape(str(path)))


def _beside(log: Path) -> Path:
    """The nearest folder above whose files no SHA256SUMS lists: there, one more is no damage."""
    from sim.recording.sums import SUMS

    free = (folder for folder in log.parents if not (folder / SUMS).exists())
    return next(free, log.parent)
