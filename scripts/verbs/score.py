# SPDX-License-Identifier: Apache-2.0
"""``mobilia score``: the bag of a stack that ran on our robot or our data, scored as any SLAM."""

from functools import partial
from pathlib import Path

from scripts import options
from scripts.names import run_name
from scripts.spec import REQUIRED, argument, option, spec
from slam.errors import InvalidValueError, LogFormatError

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
    pose: str | None = option(
        "Topic of its poses, such as /amcl_pose; default map -> odom on /tf, or map -> robot."
    )
    map_frame: str = option("Its frame of the map.", "map")
    odom_frame: str | None = option("Its frame of odometry; default that of the log's odometry.")
    clock_offset: float = option(
        "To be added to its stamps, s, where its clock was another one.", 0.0
    )
    out: Path | None = option("Folder to write; default out/score-<bag>.", writes=True)
    overwrite: bool = options.OVERWRITE()
    film: bool = options.FILM(False, "--film/--no-film")

    def __call__(self) -> None:
        from scripts.single_run.run import Log, on_log
        from slam.frames import EPOCH, NS_PER_S
        from slam.logs.bag import frames_of_odometry, read_bag
        from slam.logs.bag_topics import is_bag
        from slam.ros.messages import ODOM
        from slam.ros.recorded import RecordedSlam, aligned, is_odometry, read_statements
        from slam.shaped import within
        from slam.system import register

        within("--clock-offset", self.clock_offset, -MOST_OFFSET_S, MOST_OFFSET_S)
        log = self.bag if self.on is None else self.on
        for path in (self.bag, log):
            if path.exists() and not is_bag(path):
                raise LogFormatError(path, "is no bag of ROS: its folder, .mcap, .db3 or .bag")
        stream = read_bag(log)
        odom, robot = frames_of_odometry(log)
        if self.odom_frame not in (None, odom or self.odom_frame):
            raise InvalidValueError(
                f"--odom-frame: the odometry of {log} is in the frame '{odom}', got "
                f"'{self.odom_frame}'; without it, {self.map_frame} -> {robot} is followed on /tf"
            )
        odom = odom or self.odom_frame or ODOM
        epoch_ns = int(stream.metadata.extra.get(EPOCH, 0))
        shift_ns = epoch_ns - round(self.clock_offset * NS_PER_S)
        driven = (frame.odometry for frame in stream)
        if self.pose is None and not is_odometry(self.bag, (odom, robot), driven, shift_ns):
            odom = robot  # theirs is another one of that name
        said, poses = read_statements(
            self.bag, pose=self.pose, frames=(self.map_frame, odom), robot=robot
        )
        statements = aligned(
            self.bag, said, next(iter(stream)).stamp_ns, offset_s=self.clock_offset,
            epoch_ns=epoch_ns,
        )  # fmt: skip
        register(NAME)(partial(RecordedSlam, statements, poses=poses))
        folder = self.out or Path("out") / f"score-{run_name(self.bag)}"
        on_log([NAME], Log(path=log), folder, overwrite=self.overwrite, film=self.film)
