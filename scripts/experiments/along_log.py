# SPDX-License-Identifier: Apache-2.0
"""One SLAM along one log, into a NumPy archive: ``python along_log.py LOG OUT.npz --slam NAME``.

It takes ``slam`` from the folder in which it is started, whatever commit is checked out there, and
nothing else of this project. The archive has a row a scan: ``stamps_ns``, poses ``online`` and
``final`` (n, 3) in the map, ``odometry`` and ``reference`` (n, 3; NaN where nobody measured it),
``covariance`` (n, 3, 3), ``converged``, and ``spent_ms`` of processor time, NaN where a kernel was
compiled or loaded meanwhile.
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
    parser.add_argument("--scan", help="topic of the scans of a bag")
    return parser


def run(log: Path, slam: str, config: Any, laser: Any, scan: str | None) -> dict[str, Any]:
    """The arrays of the archive."""
    import numpy as np
    from numba.core import event

    from slam.frames import EPOCH
    from slam.logs import open_log, read_bag
    from slam.replay import Replay
    from slam.system import create

    stream = read_bag(log, scan=scan) if scan else open_log(log)
    specs: dict[int, Any] = {}  # one object for all scans, as a SLAM may keep tables of it

    def mounted(frame: Any) -> Any:
        spec = frame.scan.spec
        key = id(spec)
        if key not in specs:
            specs[key] = spec, replace(spec, T_robot_laser=np.array(laser, dtype=np.float64))
        return replace(frame, scan=replace(frame.scan, spec=specs[key][1]))

    if laser is not None:
        inner = stream
        stream = replace(stream, frames=lambda: map(mounted, inner.frames()))
    replay = Replay.of({slam: create(slam, **({"config": config} if config else {}))})
    track, loaded, odometry, reference = replay.tracks[slam], [], [], []
    with event.install_recorder("numba:compiler_lock") as compiled:
        for frame in replay.run(stream):
            loaded.append(len(compiled.buffer))
            odometry.append(frame.odometry.T_odom_robot)
            reference.append(np.full(3, np.nan) if frame.truth is None else frame.truth)
    online = track.online()
    final = track.final() or online
    spent_ms = 1e3 * np.array(track.durations_s)
    spent_ms[np.diff(loaded, prepend=0) > 0] = np.nan
    return {
        "stamps_ns": online.stamps_ns + int(stream.metadata.extra.get(EPOCH, 0)),
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

    arrays = run(given.log, given.slam, given.config, given.laser, given.scan)
    np.savez_compressed(given.out, **arrays)


if __name__ == "__main__":
    main()
