# SPDX-License-Identifier: Apache-2.0
"""One episode from its recipe: simulated, written, and put in its place when it is whole."""

import math
import os
import shutil
import socket
from array import array
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from sim.actors.rearranging import Rearrangement
from sim.moments import Moment, toured
from sim.recording import topics
from sim.recording.bag import FORMAT, BagWriter
from sim.recording.recipe import RECIPE, Recipe, write_recipe
from sim.recording.sums import write_sums
from sim.recording.tables import REARRANGED, write_rearranged, write_relations
from sim.simulation import Simulation
from sim.twins.twins import TWINS, Twins
from slam.errors import OutputError
from slam.files import PART, put, reason
from slam.frames import BeamClass, Frame
from slam.maps import write_map
from slam.ros.template import EPOCH_NS
from slam.trajectory import Trajectory, write_tum

Result = dict[str, Any]


class _Summary:
    """What is said of an episode; 32 bytes a frame are all that it keeps."""

    def __init__(self) -> None:
        self._stamps, self._poses = array("q"), array("d")
        self._classes = np.zeros(len(BeamClass), dtype=np.int64)
        self._distance_m = 0.0

    def take(self, frame: Frame) -> None:
        """Count a frame."""
        if frame.truth is not None:
            pose = frame.truth.tolist()
            if self._poses:
                x, y = self._poses[-3:-1]
                self._distance_m += math.hypot(pose[0] - x, pose[1] - y)
            self._stamps.append(frame.stamp_ns)
            self._poses.extend(pose)
        if frame.labels is not None:
            self._classes += np.bincount(frame.labels.kind, minlength=len(BeamClass))

    def truth(self) -> Trajectory:
        """The true poses so far, at the times of the bag."""
        poses = np.array(self._poses).reshape(-1, 3)
        stamps_ns = np.array(self._stamps) + EPOCH_NS
        return Trajectory(stamps_ns=stamps_ns, poses=poses)

    def result(self) -> Result:
        """Numbers for the recipe: how many frames, m driven, returns by what they came from."""
        names = (BeamClass.STATIC, BeamClass.SEMI_STATIC, BeamClass.MOVING)
        return {
            "frames": len(self._stamps),
            "distance_m": round(self._distance_m, 6),
            "returns": {c.name.lower(): int(self._classes[c]) for c in names},
        }


def record(
    recipe: Recipe,
    parent: Path,
    *,
    note: Callable[[], None] = lambda: None,
    beside: Callable[[Path], object] = lambda episode: None,
) -> dict[str, Result]:
    """Make the episode's folder in ``parent``, or the folders of all three twins.

    A recipe whose ``twin`` is "dynamic" makes the other two as well: one drive makes all three.
    ``note`` is called after each frame, ``beside`` with each folder once all that follows from the
    recipe is in it: it may write more files, which are listed like the others. Folders appear when
    they are whole; one that is there already is left as it is. Returns the results by folder name.
    Raises ``OutputError`` naming the folder that cannot be written.
    """
    if not recipe.twin:
        simulation = Simulation(**recipe.simulation())
        moments = toured(simulation, recipe.seconds)
        return {recipe.name: _write(recipe, parent, simulation, moments, note, beside)}
    twins = Twins(**recipe.simulation(), seconds=recipe.seconds)
    results = {}
    for name in TWINS:
        own = recipe.of_twin(name)
        moments = twins.moments(name)
        results[own.name] = _write(own, parent, twins.simulation, moments, note, beside)
    return results


def _write(
    recipe: Recipe,
    parent: Path,
    simulation: Simulation,
    moments: Iterator[Moment],
    note: Callable[[], None],
    beside: Callable[[Path], object],
) -> Result:
    scene, summary = simulation.world.scene, _Summary()
    rearranged: list[Rearrangement] = []
    with _whole(parent / recipe.name) as folder:
        bag = BagWriter(
            folder, *simulation.specs, movers=scene.movers, height_m=scene.scan_height_m,
            static_map=scene.static_map,
        )  # fmt: skip
        with bag:
            for moment in moments:
                bag.write(moment)
                summary.take(moment.frame)
                rearranged += moment.rearranged
                note()
        truth = summary.truth()
        write_tum(folder / "trajectory.tum", truth)
        write_relations(folder / "relations.txt", truth)
        write_map(folder / "map", scene.static_map)
        if recipe.rearranges:
            write_rearranged(folder / REARRANGED, rearranged, scene.bounds)
        sha256 = bag.messages_sha256
        result = {**summary.result(), "bag_format": FORMAT, "messages_sha256": sha256}
        if topics.names():
            result["topics"] = topics.names()
        write_recipe(folder / RECIPE, recipe, result)
        beside(folder)
        write_sums(folder)
        size = sum(file.stat().st_size for file in folder.iterdir())
    return {**result, "bytes": size}


@contextmanager
def _whole(path: Path) -> Iterator[Path]:
    """A folder of that name somewhere else, moved onto ``path`` when the block succeeds."""
    aside = path.parent / f".{path.name}.{socket.gethostname()}.{os.getpid()}{PART}"
    try:
        try:
            shutil.rmtree(aside, ignore_errors=True)
            aside.mkdir()
            yield aside / path.name
            if path.exists():  # somebody else was faster, with the same bytes
                return
            put(aside / path.name, path)
        finally:
            shutil.rmtree(aside, ignore_errors=True)
    except OSError as error:
        raise OutputError(f"cannot write {path}: {reason(error, path.parent)}") from error
