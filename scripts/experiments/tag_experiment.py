# SPDX-License-Identifier: Apache-2.0
"""Is the stand-in for ceiling tags honest? Render a ceiling camera, detect the tag, compare.

    python -m scripts.experiments.tag_experiment --out docs

puts an AprilTag (36h11) on the robot and a camera on the ceiling of the office, renders pictures
with ``sim.view.camera``, detects the tag with OpenCV, solves for its pose, and sets the errors
beside those that ``sim.sensors.tag_cameras`` draws. Needs OpenGL; draws the picture of ``tags.md``
and fills in its table.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from pathlib import Path

import cv2
import mujoco
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from scenes import registry
from scripts.figures import save
from scripts.marks import fill_page
from sim.sensors.tag_cameras import TagCameraConfig, TagCameras
from sim.view.camera import Camera
from sim.world.world import World
from slam import se2
from slam.frames import Float

DICTIONARY = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
TAG_ID, TAG_M, TAG_HEIGHT = 7, 0.24, 0.52  # side of the black square; top of the plate
CEILING_M, FOVY_DEG = 2.7, 75.0
WIDTH, HEIGHT = 1280, 960
BLUE, RED = "#1f61be", "#ce2c3c"


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What came of all pictures.

    errors     (n, 3) of the detected, x m, y m, yaw rad; ``distances`` (n,) from the middle, m
    agree      (2, 2) how many: rows detected no, yes; columns seen by the stand-in no, yes
    """

    errors: Float
    distances: Float
    agree: NDArray[np.int64]

    @property
    def found(self) -> int:
        """How many were detected."""
        return int(self.agree[1].sum())

    @property
    def tried(self) -> int:
        """How many pictures."""
        return int(self.agree.sum())


def add_tag(spec: mujoco.MjSpec) -> None:
    """A plate with the marker on the robot, cell by cell; above the scan plane."""
    cells = cv2.aruco.generateImageMarker(DICTIONARY, TAG_ID, 8, borderBits=1) > 127
    body, cell = spec.body("robot/base"), TAG_M / 8
    flat = {"type": mujoco.mjtGeom.mjGEOM_BOX, "contype": 0, "conaffinity": 0, "group": 1}
    white, black = [0.95, 0.95, 0.95, 1.0], [0.02, 0.02, 0.02, 1.0]
    edge = 0.5 * TAG_M + cell
    body.add_geom(size=[edge, edge, 0.004], pos=[0, 0, TAG_HEIGHT - 0.006], rgba=white, **flat)
    for row, column in np.argwhere(~cells).tolist():
        x, y = (3.5 - row) * cell, (3.5 - column) * cell  # the picture's up is the robot's ahead
        size = [0.5 * cell, 0.5 * cell, 0.001]
        body.add_geom(size=size, pos=[x, y, TAG_HEIGHT - 0.001], rgba=black, **flat)


def build(seed: int) -> tuple[World, tuple[float, float]]:
    """The office with tag and ceiling camera; the spot beneath the camera, a goal of the scene."""
    scene = registry.build("office", seed)
    spot = scene.goals[min(scene.goals)]
    add_tag(scene.spec)
    scene.spec.worldbody.add_camera(name="ceiling", pos=[*spot, CEILING_M], fovy=FOVY_DEG)
    return World(scene, seed=seed, dynamism=0.0), (float(spot[0]), float(spot[1]))


def pose_of(picture: NDArray[np.uint8], spot: tuple[float, float]) -> Float | None:
    """(3,) pose of the tag in the world as a ceiling camera finds it, None when it does not."""
    corners, ids, _ = cv2.aruco.ArucoDetector(DICTIONARY).detectMarkers(
        cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
    )
    if ids is None or TAG_ID not in ids.ravel():
        return None
    seen = corners[ids.ravel().tolist().index(TAG_ID)][0].astype(np.float64)
    focal = 0.5 * HEIGHT / math.tan(math.radians(0.5 * FOVY_DEG))
    # The plate is level and its height known: similar triangles, no need to solve for depth.
    scale = (CEILING_M - TAG_HEIGHT) / focal
    x = spot[0] + (seen[:, 0] + 0.5 - 0.5 * WIDTH) * scale
    y = spot[1] - (seen[:, 1] + 0.5 - 0.5 * HEIGHT) * scale
    # Corners: top left, top right, bottom right, bottom left of the marker; its up is ahead.
    ahead = (x[0] + x[1] - x[2] - x[3], y[0] + y[1] - y[2] - y[3])
    return np.array([x.mean(), y.mean(), math.atan2(ahead[1], ahead[0])])


def place(world: World, name: str, pose: Float) -> None:
    """Put a planar mover somewhere, without asking the physics."""
    for axis, value in zip(("x", "y", "yaw"), pose.tolist(), strict=True):
        world.data.joint(f"{name}/{axis}").qpos[0] = value


def experiment(pictures: int, seed: int = 0) -> tuple[Outcome, NDArray[np.uint8]]:
    """Render and detect at random poses beneath the camera; the outcome and one picture.

    In every other picture somebody stands 0.4 to 0.9 m from the robot.
    """
    world, spot = build(seed)
    rng = np.random.default_rng(seed)
    bounds = (spot[0] - 1.0, spot[1] - 1.0, spot[0] + 1.0, spot[1] + 1.0)
    stand_in = TagCameras(world.model, bounds, TagCameraConfig(rate_hz=1000.0))
    errors, distances, example = [], [], np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    agree = np.zeros((2, 2), dtype=np.int64)
    with Camera(world.model, WIDTH, HEIGHT) as camera:
        for k in range(pictures):
            true = np.array([*rng.uniform((-1.6, -1.2), (1.6, 1.2)) + spot, rng.uniform(-3, 3)])
            way, away = rng.uniform(-math.pi, math.pi), rng.uniform(0.4, 0.9)
            person = true + np.array([away * math.cos(way), away * math.sin(way), 0.0])
            gone = np.array([50.0, 0.0, 0.0])
            place(world, "robot", true)
            place(world, "person0", person if k % 2 else gone)
            mujoco.mj_forward(world.model, world.data)
            stand_in.note(k * 10_000_000, world.data)
            reading = stand_in.latest((k + 10) * 10_000_000)
            assert reading is not None
            picture = camera.render(world.data, "ceiling")
            found = pose_of(picture, spot)
            agree[int(found is not None), int(reading.camera[0] >= 0)] += 1
            if found is None:
                continue
            example = picture if not example.any() or k == 1 else example
            error = found - true
            error[2] = se2.wrap(float(error[2]))
            errors.append(error)
            distances.append(math.hypot(true[0] - spot[0], true[1] - spot[1]))
    found_at = Outcome(errors=np.array(errors), distances=np.array(distances), agree=agree)
    return found_at, example


def figure(outcome: Outcome, stand_in: TagCameraConfig, picture: NDArray[np.uint8]) -> Figure:
    """What the camera sees, and errors of detection beside those of the stand-in."""
    out = Figure(figsize=(10.0, 3.4), layout="constrained")
    view, plane, turn = out.subplots(1, 3, width_ratios=(1.35, 1.0, 1.0))
    view.imshow(picture[::2, ::2])
    view.set_axis_off()
    view.set_title("the ceiling camera", fontsize=9)
    drawn = np.random.default_rng(1).normal(size=(outcome.found, 3))
    shift = drawn[:, :2] * stand_in.noise_std_m
    plane.plot(*(1e3 * shift.T), ".", color=RED, ms=4, alpha=0.5, label="stand-in draws")
    plane.plot(*(1e3 * outcome.errors[:, :2].T), ".", color=BLUE, ms=5, label="rendered, detected")
    plane.set(xlabel="x error [mm]", ylabel="y error [mm]", aspect="equal")
    bins = np.linspace(-3.0, 3.0, 31)
    degrees = np.rad2deg(outcome.errors[:, 2])
    turn.hist(np.rad2deg(drawn[:, 2] * stand_in.noise_std_rad), bins, color=RED, alpha=0.5)
    turn.hist(degrees, bins, color=BLUE, alpha=0.8)
    turn.set(xlabel="yaw error [°]", ylabel="pictures")
    plane.legend(fontsize=7)
    return out


def table(outcome: Outcome, stand_in: TagCameraConfig) -> str:
    """What stands on the page between its marks."""
    rms = np.sqrt((outcome.errors**2).mean(axis=0))
    bias = outcome.errors.mean(axis=0)
    far = outcome.distances > 1.2
    split = [1e3 * float(np.sqrt((outcome.errors[m, :2] ** 2).mean())) for m in (~far, far)]
    rows = (
        ("tag seen", f"{outcome.found} of {outcome.tried}",
         f"{outcome.agree[:, 1].sum()} of {outcome.tried}"),
        ("seen by this one only", f"{outcome.agree[1, 0]}", f"{outcome.agree[0, 1]}"),
        ("x, y error, rms", f"{1e3 * rms[0]:.1f}, {1e3 * rms[1]:.1f} mm",
         f"{1e3 * stand_in.noise_std_m:.0f} mm"),
        ("x, y mean error", f"{1e3 * bias[0]:+.1f}, {1e3 * bias[1]:+.1f} mm",
         f"{1e3 * stand_in.bias_std_m:.0f} mm per camera"),
        ("position error within / beyond 1.2 m of the middle",
         f"{split[0]:.1f} / {split[1]:.1f} mm", "the same everywhere"),
        ("yaw error, rms", f"{math.degrees(rms[2]):.2f}°",
         f"{math.degrees(stand_in.noise_std_rad):.2f}°"),
    )  # fmt: skip
    head = "| | detected in pictures | stand-in |\n|---|---|---|"
    return "\n".join([head, *(f"| {' | '.join(row)} |" for row in rows)])


def main() -> None:
    """Fill in the page, draw its picture."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, default=Path("docs"))
    parser.add_argument("--pictures", type=int, default=100)
    wanted = parser.parse_args()
    outcome, picture = experiment(wanted.pictures)
    stand_in = TagCameraConfig()
    (wanted.out / "pictures").mkdir(parents=True, exist_ok=True)
    save(figure(outcome, stand_in, picture), wanted.out / "pictures" / "tags.png")
    fill_page(wanted.out / "tags.md", "tags", table(outcome, stand_in))
    print(f"wrote {wanted.out / 'tags.md'}: {outcome.found} of {outcome.tried} found")


if __name__ == "__main__":
    main()
