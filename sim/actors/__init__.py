# SPDX-License-Identifier: Apache-2.0
"""What moves in a room: chairs, loads, doors, the robot; people in a room of their own."""
