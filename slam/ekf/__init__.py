# SPDX-License-Identifier: Apache-2.0
"""The rival: EKF-SLAM on point landmarks, joint compatibility, landmarks that come and go."""
