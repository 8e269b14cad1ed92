# SPDX-License-Identifier: Apache-2.0
"""Scanner models, one file each; ``sim.sensors.lidar.registry`` lists them."""
