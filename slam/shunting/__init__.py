# SPDX-License-Identifier: Apache-2.0
"""SLAM on a shunting short-term memory: a neural map that forgets what moved."""

from slam.shunting.featured import FeaturedShuntingSlam
from slam.shunting.slam import ShuntingConfig, ShuntingSlam

__all__ = ["FeaturedShuntingSlam", "ShuntingConfig", "ShuntingSlam"]
