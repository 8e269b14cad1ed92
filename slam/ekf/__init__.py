# SPDX-License-Identifier: Apache-2.0
"""EKF-SLAM to compare with: point landmarks, joint compatibility, landmarks that come and go."""

from slam.ekf.config import EkfConfig
from slam.ekf.slam import EkfSlam
from slam.estimate import Landmarks

__all__ = ["EkfConfig", "EkfSlam", "Landmarks"]
