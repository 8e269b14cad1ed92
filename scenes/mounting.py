# SPDX-License-Identifier: Apache-2.0
"""The height at which the robot carries its scanner: what a beam sees of a room depends on it.

At 0.1 m a five-star chair shows its arms, at 0.36 m its column, at 0.46 m the edge of its seat.
"""

from __future__ import annotations

from dataclasses import replace

from scenes.scene import Scene, within

LASER = "robot/laser"
PICTURED = "robot/scanner"  # geoms whose names begin so are the scanner's picture
FOOT = "robot/scanner_foot"  # ... and this one stands on the deck
LOWEST, HIGHEST = 0.05, 1.0  # m; walls are cut at 1.1 m


def at_scan_height(scene: Scene, scan_height_m: float) -> Scene:
    """The scene with the robot's scanner so high above the floor; the given one is left as it is.

    Raises ``InvalidValueError`` outside 0.05 to 1 m.
    """
    height = within("scan_height_m", scan_height_m, LOWEST, HIGHEST)
    if height == scene.scan_height_m:
        return scene
    spec, up = scene.spec.copy(), height - scene.scan_height_m
    site = spec.site(LASER)
    if site is not None:
        site.pos = [site.pos[0], site.pos[1], site.pos[2] + up]
    for geom in spec.geoms:
        if not geom.name.startswith(PICTURED):
            continue
        rise = up
        if geom.name == FOOT:  # longer or shorter; sunk in the chassis with a low scanner
            rise = 0.5 * max(up, 2.0 * (0.005 - float(geom.size[2])))
            geom.size = [geom.size[0], geom.size[1], geom.size[2] + rise]
        geom.pos = [geom.pos[0], geom.pos[1], geom.pos[2] + rise]
    return replace(scene, spec=spec, scan_height_m=height)
