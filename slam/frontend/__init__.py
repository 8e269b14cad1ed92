# SPDX-License-Identifier: Apache-2.0
"""What every SLAM may use: odometry prior, de-skewed observations, what is in view."""
