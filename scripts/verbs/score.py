# SPDX-License-Identifier: Apache-2.0
"""``mobilia score``: the bag of a stack that ran on our robot or our data, scored as any SLAM."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from scripts.names import run_name
from scripts.options import Overwrite

NAME = "recorded"
MOST_OFFSET_S = 1e10  # 300 years: what is more is no clock


def score(
    bag: Annotated[Path, typer.Argument(help="The bag with what the stack said.")],
    on: Annotated[
        Path | None,
        typer.Option(
            help="The bag of ours that it ran on; default: the same bag has scans, "
            "odometry and /ground_truth/pose, too."
        ),
    ] = None,
    pose: Annotated[
        str | None,
        typer.Option(help="Topic of its poses, such as /amcl_pose; default map -> odom on /tf."),
    ] = None,
    map_frame: Annotated[str, typer.Option(help="Its frame of the map.")] = "map",
    odom_frame: Annotated[str, typer.Option(help="Its frame of odometry.")] = "odom",
    clock_offset: Annotated[
        float, typer.Option(help="To be added to its stamps, s, where its clock was another one.")
    ] = 0.0,
    out: Annotated[
        Path | None, typer.Option(help="Folder to write; default out/score-<bag>.")
    ] = None,
    overwrite: Overwrite = False,
    film: Annotated[bool, typer.Option(help="Write film.mp4.")] = False,
) -> None:
    """Score what a stack of ROS 2 said in a bag: the metrics, the verdict and the table of `run`.

    [bold]mobilia score my_bag[/bold]

    [bold]mobilia score my_bag --on out/dataset/episode-0/bag --pose /amcl_pose[/bold]
    """  # fmt: skip
    from scripts.single_run.run import Log, on_log
    from slam.frames import EPOCH
    from slam.logs.bag import read_bag
    from slam.ros.recorded import RecordedSlam, aligned, read_statements
    from slam.shaped import within
    from slam.system import register

    within("--clock-offset", clock_offset, -MOST_OFFSET_S, MOST_OFFSET_S)
    log = bag if on is None else on
    stream = read_bag(log)
    statements = aligned(
        bag, read_statements(bag, pose=pose, frames=(map_frame, odom_frame)),
        next(iter(stream)).stamp_ns, offset_s=clock_offset,
        epoch_ns=int(stream.metadata.extra.get(EPOCH, 0)),
    )  # fmt: skip
    register(NAME)(partial(RecordedSlam, statements, poses=pose is not None))
    folder = out or Path("out") / f"score-{run_name(bag)}"
    on_log([NAME], Log(path=log), folder, overwrite=overwrite, film=film)
