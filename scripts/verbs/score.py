# SPDX-License-Identifier: Apache-2.0
"""``mobilia score``: the bag of a stack that ran on our robot or our data, scored as any SLAM."""

from functools import partial
from pathlib import Path

from scripts import options
from scripts.names import run_name
from scripts.spec import REQUIRED, argument, option, spec

NAME = "recorded"
MOST_OFFSET_S = 1e10  # 300 years: what is more is no clock


@spec
class Score:
    """Score what a stack of ROS 2 said in a bag: the metrics, the verdict and the table of `run`.

    [bold]mobilia score my_bag[/bold]

    [bold]mobilia score my_bag --on out/dataset/episode-0/bag --pose /amcl_pose[/bold]
    """  # fmt: skip

    bag: Path = argument("The bag with what the stack said.", REQUIRED)
    on: Path | None = option(
        "The bag of ours that it ran on; default: the same bag has scans, "
        "odometry and /ground_truth/pose, too."
    )
    pose: str | None = option("Topic of its poses, such as /amcl_pose; default map -> odom on /tf.")
    map_frame: str = option("Its frame of the map.", "map")
    odom_frame: str = option("Its frame of odometry.", "odom")
    clock_offset: float = option(
        "To be added to its stamps, s, where its clock was another one.", 0.0
    )
    out: Path | None = option("Folder to write; default out/score-<bag>.", writes=True)
    overwrite: bool = options.OVERWRITE()
    film: bool = options.FILM(False, "--film/--no-film")

    def __call__(self) -> None:
        from scripts.single_run.run import Log, on_log
        from slam.frames import EPOCH
        from slam.logs.bag import read_bag
        from slam.ros.recorded import RecordedSlam, aligned, read_statements
        from slam.shaped import within
        from slam.system import register

        within("--clock-offset", self.clock_offset, -MOST_OFFSET_S, MOST_OFFSET_S)
        log = self.bag if self.on is None else self.on
        stream = read_bag(log)
        frames = (self.map_frame, self.odom_frame)
        statements = aligned(
            self.bag, read_statements(self.bag, pose=self.pose, frames=frames),
            next(iter(stream)).stamp_ns, offset_s=self.clock_offset,
            epoch_ns=int(stream.metadata.extra.get(EPOCH, 0)),
        )  # fmt: skip
        register(NAME)(partial(RecordedSlam, statements, poses=self.pose is not None))
        folder = self.out or Path("out") / f"score-{run_name(self.bag)}"
        on_log([NAME], Log(path=log), folder, overwrite=self.overwrite, film=self.film)
