# SPDX-License-Identifier: Apache-2.0
"""A scene from a plan alone: whatever its marks ask for, and chairs and people besides.

``arena``, ``office`` and the others are recipes of their own, as they have options of their own.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

from scenes.kinds import kind_of
from scenes.plan import furniture
from scenes.recipe import Draws, count, finish, furnished, planned
from scenes.scene import Pose, Scene


def filled(  # noqa: PLR0913 (the counts of a scene, each by name)
    plan: str | Path,
    seed: int,
    *,
    parts: Sequence[str | Path] = (),
    put: Sequence[tuple[str | Path, Pose]] = (),
    n_chairs: int = 0,
    n_people: int = 0,
    loads: Mapping[str, int] | None = None,
    doors: str = "open",
) -> Scene:
    """The scene of a plan: furniture, doors and bins at its marks, then chairs and people.

    plan    path of an MJCF file, or the name of one of ``scenes/plans``
    parts   paths of MJCF files of furniture: each is put wherever a mark starts with its name
    put     furniture where no mark is: (path or name, (x m, y m, yaw rad)), its back to +y
    loads   how many of each kind that is pushed about, ``spot:KIND:N`` marks first: {"trolley": 2}
    doors   how they rest: "open", "ajar", "closed" or "mixed"

    Chairs take the ``seat:...`` marks first, then free floor. Raises ``InvalidValueError`` for a
    file, mark, material or number that cannot be, ``UnknownNameError`` for a kind of load.
    """
    n_chairs, n_people = count("n_chairs", n_chairs, 0), count("n_people", n_people, 0)
    more = tuple((str(part), (pose[0], pose[1], pose[2])) for part, pose in put)
    walls = planned(str(plan), (*map(str, parts), *furniture()), put=more)
    for kind in loads or {}:
        kind_of(kind)  # an unknown one is refused with the kinds that there are
    loaded = {kind: count(f"loads[{kind!r}]", n, 0) for kind, n in (loads or {}).items()}
    builder = furnished(walls, Draws(seed), n_chairs, n_people, doors, loaded)
    options: dict[str, object] = {"n_chairs": n_chairs, "n_people": n_people, "doors": doors}
    options |= {"loads": dict(loads)} if loads else {}
    return finish(builder, Path(plan).stem, seed, options)
