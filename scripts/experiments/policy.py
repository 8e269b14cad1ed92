# SPDX-License-Identifier: Apache-2.0
"""The least policy that gets about, in eight rooms at once.

``python -m scripts.experiments.policy``.
"""

import argparse

import gymnasium
import numpy as np

import sim  # noqa: F401  (registers the environments)

if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__).parse_args()
    rooms = gymnasium.make_vec(
        "mobilia/Office-v2", num_envs=8, vectorization_mode="vector_entry_point"
    )
    seen, infos = rooms.reset(seed=1)
    start, hits = infos["pose"].copy(), 0
    for _step in range(750):  # 20 s
        ranges = seen["ranges"]
        ahead = ranges[:, 150:211].min(axis=1)  # beam 180 looks straight ahead, 0 to the right
        turn = np.where(ranges[:, 200:300].mean(1) > ranges[:, 60:160].mean(1), 0.8, -0.8)
        speed = np.clip(ahead - 0.6, 0.0, 0.6)
        action = np.stack([speed, np.where(ahead < 1.2, turn, 0.0)], axis=1)
        seen, *_rest, infos = rooms.step(action)
        hits += int(infos["hard_collision"].sum())
    away = np.hypot(*(infos["pose"] - start)[:, :2].T)
    print(f"away from the start: {away.mean():.1f} m on average; steps with a hard contact: {hits}")
    rooms.close()
