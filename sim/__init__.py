# SPDX-License-Identifier: Apache-2.0
"""The moving world: importing it registers an environment ``mobilia/<Scene>-v0`` for each scene."""

from gymnasium.envs.registration import register, registry

_SCENES = {
    "Arena": "arena",
    "Office": "office",
    "Corridor": "corridor",
    "Warehouse": "warehouse",
    "Classroom": "classroom",
    "Apartment": "apartment",
    "RandomRooms": "random-rooms",
}
for _name, _scene in _SCENES.items():
    _id = f"mobilia/{_name}-v0"
    if _id not in registry:
        register(
            id=_id,
            entry_point="sim.env:MobiliaEnv",
            vector_entry_point="sim.vector:MobiliaVectorEnv",
            kwargs={"scene": _scene},
        )
