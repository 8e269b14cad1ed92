# SPDX-License-Identifier: Apache-2.0
"""How sure the shunting SLAM is: pose covariance, residuals, odometry noise."""
