# SPDX-License-Identifier: Apache-2.0
"""The moving world: importing it registers an environment ``mobilia/<Scene>-v2`` for each scene.

The number is the version of the world (``sim.core.versions``); ids of older ones say what became
of it. ``mobilia/<Scene>Goal-v2`` is the same with a random goal, the shaped reward and four scans
to a step: ready to train.
"""

from functools import partial

from gymnasium.envs.registration import register, registry

import mobilia

if _sentence := mobilia.hidden("slam", "scenes"):
    raise ImportError(_sentence)

from scenes.registry import OWN
from sim.core.versions import WORLD, gone

for _scene in OWN:  # "random-rooms" is mobilia/RandomRooms-v2
    _name = _scene.title().replace("-", "")
    for _version in range(WORLD + 1):
        _id = f"mobilia/{_name}-v{_version}"
        if _id in registry:
            continue
        if _version < WORLD:
            _gone = partial(gone, f"mobilia/{_name}", _version)
            register(id=_id, entry_point=_gone, vector_entry_point=_gone)
            continue
        register(
            id=_id,
            entry_point="sim.gym.env:MobiliaEnv",
            vector_entry_point="sim.gym.vector:MobiliaVectorEnv",
            kwargs={"scene": _scene},
        )
        register(
            id=f"mobilia/{_name}Goal-v{_version}",
            entry_point="sim.gym.env:MobiliaEnv",
            vector_entry_point="sim.gym.vector:MobiliaVectorEnv",
            kwargs={"scene": _scene, "goal": "random", "reward": "shaped", "frame_skip": 4},
        )
