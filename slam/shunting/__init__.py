# SPDX-License-Identifier: Apache-2.0
"""SLAM on a shunting short-term memory: a neural map that forgets what moved."""

from slam.shunting.config import ShuntingConfig
from slam.shunting.featured import FeaturedShuntingSlam
from slam.shunting.slam import ShuntingSlam

__all__ = ["FeaturedShuntingSlam", "ShuntingConfig", "ShuntingSlam"]
