# SPDX-License-Identifier: Apache-2.0
"""The scene that a world begins with: built, and with a crowd in it."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from scenes import build, look
from scenes.assembly import Assembly
from scenes.crowd import Crowd, crowd_of, mix
from scenes.crowd_kinds import with_crowd
from scenes.scene import Scene
from sim.actors.rearranging import place_out
from sim.core.dynamism import Dynamism
from sim.core.seeds import Seeds
from slam.errors import InvalidValueError
from slam.shaped import Pose, instance, shaped

VISITOR = "visitor"  # their names begin so
_STREAM = 101  # of a scene's seed, for their clothes; that of its crowd is 100


def populated(
    scene: Scene | str,
    seeds: Seeds,
    rates: Dynamism,
    start: Sequence[float] | None,
    options: dict[str, Any],
) -> Scene:
    """A scene by name, built with ``options`` and with its crowd; a built one stays as it is.

    Raises ``InvalidValueError`` for options of a built scene.
    """
    if isinstance(scene, str):
        given = options.pop("crowd", None)
        built = build(scene, seed=seeds.integer("layout"), **options)
        return crowded(built, crowd_for(scene, given, rates), start, as_many_as_fit=given is None)
    if options:
        raise InvalidValueError(f"a built scene takes no options, got {', '.join(options)}")
    instance("scene", scene, Scene)
    return scene


def crowd_for(scene: Scene | str, given: object, rates: Dynamism) -> Crowd:
    """The crowd that is given, else the mix of the scene of that name; of a built one nobody."""
    if given is not None:
        return crowd_of(given)
    return mix(scene, rates.crowd) if isinstance(scene, str) else Crowd()


def crowded(
    built: Scene,
    crowd: Crowd,
    start: Sequence[float] | None,
    session: int = 0,
    *,
    as_many_as_fit: bool,
) -> Scene:
    """The scene with that crowd around the robot, which begins at ``start`` where one is given."""
    if not crowd:
        return built
    return with_crowd(_begun(built, start), crowd, session, as_many_as_fit=as_many_as_fit)


def _begun(scene: Scene, start: Sequence[float] | None) -> Scene:
    """The scene with the robot at ``start``, where one is given."""
    if start is None or not scene.movers or scene.movers[-1].kind != "robot":
        return scene
    pose = shaped("start", start, Pose)
    return replace(scene, start=pose, initial={**scene.initial, "robot": pose})


def with_visitors(scene: Scene, n: int) -> Scene:
    """The scene with ``n`` people more, who are out of the building until they enter."""
    if n == 0:
        return scene
    rng, parts = np.random.default_rng([scene.seed, _STREAM]), Assembly()
    movers, initial = [], {}
    for k in range(n):
        name, pose = f"{VISITOR}{k}", place_out(len(scene.movers) + k, scene.bounds)
        movers.append(parts.put_mover("person", name, pose, look.dress(rng)))
        initial[name] = pose
    spec = scene.spec.copy()
    parts.into(spec)
    return replace(
        scene, spec=spec, movers=(*scene.movers[:-1], *movers, scene.movers[-1]),
        initial={**scene.initial, **initial},
    )  # fmt: skip
