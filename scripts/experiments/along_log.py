# SPDX-License-Identifier: Apache-2.0
"""One SLAM along one log, into a NumPy archive: ``python along_log.py LOG OUT.npz --slam NAME``.

It takes ``slam`` from the folder in which it is started, whatever commit is checked out there, and
nothing else of this project. The archive has a row a scan: ``stamps_ns``, poses ``online`` and
``final`` (n, 3) in the map, ``odometry`` and ``reference`` (n, 3; NaN where nobody measured it),
``covariance`` (n, 3, 3), ``converged``, and ``spent_ms`` of processor time, NaN where a kernel was
compiled or loaded meanwhile. Stamps are those of the recording.
"""

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any


def options() -> argparse.ArgumentParser:
    """What is run along what."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("log", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--slam", default="shunting")
    parser.add_argument("--config", type=json.loads, default={}, help="numbers by path, JSON")
    parser.add_argument("--laser", type=json.loads, help="[x m, y m, theta rad] on the robot")
    parser.add_argument("--scan", nargs="+", help="topics of the scans of a bag")
    parser.add_argument("--every", type=int, default=1, help="take one scan of so many")
    parser.add_argument("--backwards", action="store_true", help="from the last scan to the first")
    return parser


def frames_of(given: argparse.Namespace) -> Any:
    """The stream of a log, its scanner where it is on the robot; perhaps not all, or reversed."""
    import numpy as np

    from slam.logs import open_log, read_bag

    if given.scan and len(given.scan) > 1:
        from slam.logs.together import together

        stream = together([read_bag(given.log, scan=topic) for topic in given.scan])
    else:
        stream = read_bag(given.log, scan=given.scan[0]) if given.scan else open_log(given.log)
    specs: dict[int, Any] = {}  # one object for all scans, as a SLAM may keep tables of it

    def mounted(frame: Any) -> Any:
        spec = frame.scan.spec
        if id(spec) not in specs:
            laser = np.array(given.laser, dtype=np.float64)
            specs[id(spec)] = spec, replace(spec, T_robot_laser=laser)
        return replace(frame, scan=replace(frame.scan, spec=specs[id(spec)][1]))

    def back(frame: Any) -> Any:
        ns = -frame.stamp_ns
        at = replace(frame.odometry, stamp_ns=ns), replace(frame.scan, stamp_ns=ns)
        return replace(frame, stamp_ns=ns, odometry=at[0], scan=at[1])

    frames = [mounted(frame) if given.laser else frame for frame in stream][:: given.every]
    if given.backwards:
        frames = [back(frame) for frame in reversed(frames)]
    return replace(stream, frames=lambda: frames, length=len(frames))


def run(given: argparse.Namespace) -> dict[str, Any]:
    """The arrays of the archive."""
    import numpy as np
    from numba.core import event

    from slam.frames import EPOCH
    from slam.replay import Replay
    from slam.system import create

    stream, config = frames_of(given), {"config": given.config} if given.config else {}
    replay = Replay.of({given.slam: create(given.slam, **config)})
    track, loaded, odometry, reference = replay.tracks[given.slam], [], [], []
    with event.install_recorder("numba:compiler_lock") as compiled:
        for frame in replay.run(stream):
            loaded.append(len(compiled.buffer))
            odometry.append(frame.odometry.T_odom_robot)
            reference.append(np.full(3, np.nan) if frame.truth is None else frame.truth)
    online = track.online()
    final = track.final() or online
    spent_ms = 1e3 * np.array(track.durations_s)
    spent_ms[np.diff(loaded, prepend=0) > 0] = np.nan
    stamps_ns = -online.stamps_ns if given.backwards else online.stamps_ns
    return {
        "stamps_ns": stamps_ns + int(stream.metadata.extra.get(EPOCH, 0)),
        "online": online.poses,
        "final": final.poses,
        "odometry": np.array(odometry) if stream.metadata.odometry else online.poses * np.nan,
        "reference": np.array(reference),
        "covariance": track.covariances(),
        "converged": np.array([estimate.converged for estimate in track.estimates]),
        "spent_ms": spent_ms,
    }


def main() -> None:
    """The command."""
    given = options().parse_args()
    sys.path[:] = [str(Path.cwd()), *sys.path[1:]]  # this file's folder has modules of other names
    import numpy as np

    np.savez_compressed(given.out, **run(given))


if __name__ == "__main__":
    main()
