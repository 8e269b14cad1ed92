# SPDX-License-Identifier: Apache-2.0
"""Whether the robot is where the SLAM believes: tracking quality, relocalisation, loops."""
