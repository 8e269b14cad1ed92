# SPDX-License-Identifier: Apache-2.0
"""A robot that goes where its SLAM believes the goals are: ``closed_loop``; truth only scores."""

from sim.loop.navigator import LoopConfig
from sim.loop.run import GoalResult, LoopRun, closed_loop

__all__ = ["GoalResult", "LoopConfig", "LoopRun", "closed_loop"]
