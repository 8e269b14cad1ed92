# SPDX-License-Identifier: Apache-2.0
"""Where the scanner looks, known without loading a scene."""

SCAN_HEIGHT = 0.36
"""Usual height of the scan plane above the floor, m (where parts/robot.xml has its laser)."""
