# SPDX-License-Identifier: Apache-2.0
"""The moving world: importing it registers an environment ``mobilia/<Scene>-v2`` for each scene.

The number is the version of the world (``sim.core.versions``). ``mobilia/<Scene>Goal-v2`` is the
same with a random goal, the shaped reward and four scans to a step: ready to train.
"""

from gymnasium.envs.registration import register, registry

import mobilia

if _sentence := mobilia.hidden("slam", "scenes"):
    raise ImportError(_sentence)

from scenes.registry import OWN
from sim.core.versions import WORLD

for _scene in OWN:  # "random-rooms" is mobilia/RandomRooms-v2
    _name = _scene.title().replace("-", "")
    for _id, _more in (
        (f"mobilia/{_name}-v{WORLD}", {}),
        (f"mobilia/{_name}Goal-v{WORLD}", {"goal": "random", "reward": "shaped", "frame_skip": 4}),
    ):
        if _id not in registry:
            register(
                id=_id,
                entry_point="sim.gym.env:MobiliaEnv",
                vector_entry_point="sim.gym.vector:MobiliaVectorEnv",
                kwargs={"scene": _scene, **_more},
            )
