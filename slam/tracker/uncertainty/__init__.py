# SPDX-License-Identifier: Apache-2.0
"""How sure a tracker is: pose covariance, residuals, odometry noise."""
