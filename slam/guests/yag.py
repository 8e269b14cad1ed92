# SPDX-License-Identifier: Apache-2.0
"""YAG SLAM 0.3: OpenKarto's matcher and pose graph, its loops closed by sparse bundle adjustment.

As in Karto a scan becomes a vertex after some way or turn; the others are matched to the latest
vertices and left. A closed loop moves earlier poses: ``trajectory`` has them as they are now.
"""

import io
import math
from contextlib import redirect_stdout
from typing import Any

import numpy as np

from slam import se2
from slam.errors import needed
from slam.frames import Float, LaserSpec
from slam.frontend.odometry_prior import Prediction
from slam.guests.guest import KEEP_M, NOTHING_M, Guest, check_beams, moved_on, ranges_of
from slam.trajectory import Trajectory

BUFFER = 20  # latest vertices matched against
LOOP_M = 3.0  # m, how far a loop may be away; its default
CHAIN = 10  # vertices of a loop, at least; its default
COARSE = 0.35  # least response of a loop, coarse; its default
FINE = 0.45  # and fine; its default, see ``begin``
RANGE_M = 20.0  # m; ranges beyond are not matched
MATCHER = {
    "search_size": 0.3,  # m across
    "resolution": 0.01,  # m
    "smear_deviation": 0.05,  # m
    "coarse_search_angle_offset": 0.35,  # rad either way
    "fine_search_angle_resolution": math.radians(0.1),
}


def _pose(transform: Any) -> Float:
    return np.array([transform.x, transform.y, transform.euler[-1]])


class YagSlam(Guest):
    """YAG SLAM, a guest: Karto's matcher with a pose graph and closed loops."""

    def __init__(self) -> None:
        self._graph: Any = needed("yag_slam.graph_slam", "yag-slam", "yag")
        self._matching: Any = needed("yag_slam.scan_matching", "yag-slam", "yag")
        self._models: Any = needed("yag_slam.models", "yag-slam", "yag")
        self._transform: Any = needed("tiny_tf.tf", "tiny-tf", "yag").Transform
        super().__init__()

    def begin(self, spec: LaserSpec) -> None:
        """An empty graph, and its two matchers."""
        check_beams(self, spec)
        self._spec = spec
        self._reach = min(spec.range_max, RANGE_M)
        reach = {"range_threshold": self._reach}
        self._matcher = self._matching.Scan2DMatcherCpp(MATCHER | reach)
        self._slam: Any = self._graph.GraphSlam(
            self._matcher,
            self._matching.Scan2DMatcherCpp(reach, loop=True),
            scan_buffer_len=BUFFER,
            loop_search_dist=LOOP_M,
            loop_search_min_chain_size=CHAIN,
            min_response_coarse=COARSE,
            min_response_fine=FINE,
            verbose=True,  # version 0.3 does not look at the fine response without it
        )
        self._places: list[tuple[int, Float]] = []  # of each frame: its vertex, T_vertex_robot

    def locate(self, points_robot: Float, prediction: Prediction) -> tuple[Float, dict[str, float]]:
        """Match to the latest vertices; make a vertex of it after some way."""
        scan = self._scan(
            points_robot, se2.compose(prediction.T_map_robot, self._spec.T_robot_laser)
        )
        latest = self._slam.running_scans
        if not latest:
            self._slam.process_scan(scan)
            return self._placed(scan, scan), {"response": 1.0}
        result = self._matcher.match_scan(scan, latest, True, True)
        scan.corrected_pose = result.best_pose
        last = latest[-1]
        if moved_on(_pose(last.corrected_pose), _pose(scan.corrected_pose), KEEP_M):
            # it starts from odometry since the last vertex: here from the match
            last.odom_pose, scan.odom_pose = last.corrected_pose, scan.corrected_pose
            with redirect_stdout(io.StringIO()):  # it says a line for each loop it tries
                self._slam.process_scan(scan)
            last = scan
        return self._placed(last, scan), {
            "response": float(result.response),
            "vertices": float(len(self._slam.graph.vertices)),
        }

    def trajectory(self) -> Trajectory:
        """The poses by the graph as it is now."""
        poses = np.empty((len(self._path), 3))
        for k, (vertex, T_vertex_robot) in enumerate(self._places[: len(poses)]):
            here = self._slam.graph.vertices[vertex].obj.corrected_pose
            poses[k] = se2.compose(_pose(here), T_vertex_robot)
        return self._path.trajectory(poses)

    def _placed(self, vertex: Any, scan: Any) -> Float:
        """The robot's pose, which is noted down by its vertex."""
        T_map_vertex = _pose(vertex.corrected_pose)
        T_laser_robot = se2.inverse(self._spec.T_robot_laser)
        T_map_robot = se2.compose(_pose(scan.corrected_pose), T_laser_robot)
        self._places.append((vertex.num, se2.between(T_map_vertex, T_map_robot)))
        return T_map_robot

    def _scan(self, points_robot: Float, T_map_laser: Float) -> Any:
        """Its own type."""
        spec = self._spec
        last = spec.angle_min + (spec.n_beams - 1) * spec.angle_increment
        return self._models.LocalizedRangeScan(
            ranges_of(points_robot, spec, NOTHING_M).tolist(),
            spec.angle_min,
            last,
            spec.angle_increment,
            spec.range_min,
            spec.range_max,
            self._reach,
            *T_map_laser.tolist(),
        )
