"""Boundaries of media that are no simple shapes: shading normals, instances.

False alarms: each mean has a limit of five standard errors (6e-7), all of them below 1e-5.
"""

from __future__ import annotations

import numpy as np
import pytest
from media_scenes import (
    NULL,
    SKY,
    assert_mean,
    described,
    homogeneous,
    parallel,
    pixels,
    scaled,
)

import renderer

# A square around x that is turned by 30 degrees, with normals that are turned by 110: a ray
# along -z meets its front, and would leave it by the normals between the vertices.
TURNED = "".join(
    f"v {x:g} {y * np.cos(np.pi / 6):.9f} {-y * np.sin(np.pi / 6):.9f}\n"
    for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))
)
TURNED += f"vn 0 {np.sin(np.radians(110)):.9f} {np.cos(np.radians(110)):.9f}\n"
TURNED += "f 1//1 2//1 3//1\nf 1//1 3//1 4//1\n"


def test_the_face_and_not_its_vertices_tells_the_side(tmp_path):
    """A lamp 1.5 behind the square, through what absorbs."""
    (tmp_path / "turned.obj").write_text(TURNED)
    square = {"type": "obj", "filename": str(tmp_path / "turned.obj"), "bsdf": NULL}
    lamp = {
        "type": "rectangle",
        "to_world": scaled(3.0, at=(0.0, 0.0, -1.5)),
        "emitter": {"type": "area", "radiance": 1.0},
    }
    sensor = {"sensor": parallel(0.005, spp=256)}
    scene = described(homogeneous(1.0), shape=square, light=lamp, more=sensor)
    assert_mean(pixels(scene), np.full(3, np.exp(-1.5)))


def with_instance(kind, to_world, medium, sensor, **parts):
    """Return a scene with an instance of a small shape that has a medium in it."""
    small = {"type": kind, "to_world": scaled(0.5), "bsdf": NULL, "interior": medium}
    return renderer.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "volpath", "rr_depth": 50},
            "sensor": sensor,
            "group": {"type": "shapegroup", "id": "group", "small": small},
            "instance": {
                "type": "instance",
                "to_world": to_world,
                "group": {"type": "ref", "id": "group"},
            },
            **parts,
        }
    )


@pytest.mark.parametrize("along", [2.0, -2.0], ids=["larger", "mirrored"])
@pytest.mark.parametrize("kind", ["cube", "sphere"])
def test_an_instance_stretches_the_way_through_its_medium(kind, along):
    """To a floor and, by a shadow ray, from there to a lamp: an optical depth of 1.4 twice.

    The medium itself has the same extinction in each instance.
    """
    floor = {"type": "rectangle", "to_world": scaled(3.0, at=(0.0, 0.0, -2.0))}
    lamp = {"type": "point", "position": [0.0, 0.0, 2.5], "intensity": 50.0}
    scene = with_instance(
        kind,
        scaled(1.0, 1.0, along),
        homogeneous(0.7),
        parallel(0.005, spp=256),
        floor=floor,
        lamp=lamp,
    )
    lit = 50.0 / 4.5**2 * 0.5 / np.pi
    assert_mean(pixels(scene), np.full(3, lit * np.exp(-2.8)))


def test_a_medium_in_an_instance_is_a_furnace():
    """Slanted and mirrored: what scatters all light is as bright as the sky."""
    slanted = np.eye(4)
    slanted[:3, :3] = [[-1.5, 0.4, 0.0], [0.3, 1.2, 0.2], [0.0, 0.5, 2.0]]
    medium = homogeneous((0.9, 0.6, 0.3), 1.0, 2.0, phase={"type": "hg", "g": 0.5})
    scene = with_instance("cube", slanted, medium, parallel(0.5, spp=64), sky=SKY)
    assert_mean(pixels(scene, seeds=12), np.ones(3))
