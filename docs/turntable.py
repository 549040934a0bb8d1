"""Frames of a camera that turns around a still life, each with an error below 2 %.

`python docs/turntable.py` writes turn_0.png to turn_9.png; the tutorial "Make pictures"
(docs/tutorials/pictures.md) walks through this file.
"""

from __future__ import annotations

import lightproof


def still_life(angle: float, width: int = 240, height: int = 160) -> lightproof.Scene:
    """Return three balls and a block on a board, seen from `angle` degrees."""
    turned = lightproof.rotate([0, 0, 1], angle)
    camera = turned @ lightproof.look_at([0, -6, 2.6], [0, 0, 0.7], [0, 0, 1])
    board = {
        "type": "checkerboard",
        "color0": {"type": "rgb", "value": [0.75, 0.72, 0.66]},
        "color1": {"type": "rgb", "value": [0.30, 0.33, 0.38]},
        "to_uv": lightproof.scale([6, 6, 1]),
    }
    red = {"type": "rgb", "value": [0.70, 0.08, 0.06]}
    return lightproof.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 8},
            "sensor": {
                "type": "perspective",
                "fov": 38.0,
                "to_world": camera,
                "film": {"type": "hdrfilm", "width": width, "height": height},
            },
            "sky": {
                "type": "constant",
                "radiance": {"type": "rgb", "value": [0.45, 0.55, 0.7]},
            },
            "lamp": {
                "type": "sphere",
                "center": [-3.0, -3.0, 6.0],
                "radius": 0.9,
                "light": {
                    "type": "area",
                    "radiance": {"type": "rgb", "value": [22, 19, 15]},
                },
            },
            "floor": {
                "type": "rectangle",
                "to_world": lightproof.scale([3, 3, 1]),
                "bsdf": {"type": "diffuse", "reflectance": board},
            },
            "plastic": {
                "type": "sphere",
                "center": [-1.1, -0.3, 0.8],
                "radius": 0.8,
                "bsdf": {"type": "plastic", "diffuse_reflectance": red},
            },
            "gold": {
                "type": "sphere",
                "center": [0.9, 0.9, 0.9],
                "radius": 0.9,
                "bsdf": {"type": "roughconductor", "material": "Au", "alpha": 0.2},
            },
            "block": {
                "type": "cube",
                "to_world": lightproof.translate([0.9, -1.2, 0.4])
                @ lightproof.rotate([0, 0, 1], 25)
                @ lightproof.scale([0.4, 0.4, 0.4]),
            },
        }
    )


if __name__ == "__main__":
    for frame in range(10):
        image = lightproof.render(
            still_life(36 * frame), spp=16384, seed=frame, target_error=0.02
        )
        image.save(f"turn_{frame}.png")
        print(image.metadata["error"], image.spp)
