# SPDX-License-Identifier: Apache-2.0
"""The moving world: importing it registers the Gymnasium environments ``mobilia/...-v0``."""

from gymnasium.envs.registration import register, registry

for _id, _scene in (("mobilia/Arena-v0", "arena"), ("mobilia/Office-v0", "office")):
    if _id not in registry:
        register(id=_id, entry_point="sim.env:MobiliaEnv", kwargs={"scene": _scene})
