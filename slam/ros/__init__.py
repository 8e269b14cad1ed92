# SPDX-License-Identifier: Apache-2.0
"""ROS 2 without ROS: its messages, and the network that they travel."""
