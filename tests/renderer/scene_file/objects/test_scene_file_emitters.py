"""Emitters: Mitsuba's defaults, positions and powers, and one error for each fault."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scene_file_samples import error_of, mitsuba_refuses, ours, parameter, theirs
from scene_xml import props, tag, to_world

from renderer.scene_file.description import (
    ConstantLight,
    DirectionalLight,
    Emitter,
    PointLight,
    SpotLight,
)

MOVED = to_world('<rotate x="1" angle="50"/><translate x="1" y="-2" z="0.5"/>')
COLOUR = '<rgb name="{}" value="1 2 3"/>'


def both(plugin: str, content: str = "") -> tuple[Emitter, Any]:
    # The sphere gives Mitsuba's directional light a scene to be outside of.
    text = f'<emitter type="{plugin}">{content}</emitter><shape type="sphere"/>'
    return ours(text).emitters[0], theirs(text).emitters()[0]


def light_at(emitter: Any, point: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return the direction to Mitsuba's light and what arrives from it at a point."""
    it = dr.zeros(mi.SurfaceInteraction3f)
    it.p = point
    ds, weight = emitter.sample_direction(it, [0.3, 0.6])
    return np.array(ds.d), np.array(weight)


@pytest.mark.parametrize(
    "content",
    ["", MOVED, '<point name="position" x="1" y="2" z="3"/>', COLOUR.format("intensity")],
)
def test_point_light_is_that_of_mitsuba(content: str) -> None:
    mine, reference = both("point", content)
    assert isinstance(mine, PointLight)
    np.testing.assert_allclose(mine.position, parameter(reference, "position"), rtol=1e-6)
    assert mine.intensity == tuple(parameter(reference, "intensity.value"))


@pytest.mark.parametrize(
    "content",
    [
        "",
        MOVED,
        COLOUR.format("intensity"),
        props(cutoff_angle=60.0),
        props(cutoff_angle=60.0, beam_width=10.0),
        '<transform name="to_world"><scale value="3"/></transform>',
        to_world('<lookat origin="0 0 1" target="1 2 0" up="0 1 0"/>')
        + props(cutoff_angle=80.0),
    ],
)
def test_spot_light_is_that_of_mitsuba(content: str) -> None:
    """The light at points around the axis, by the falloff that the record documents."""
    mine, reference = both("spot", content)
    assert isinstance(mine, SpotLight)
    rotation = mine.to_world[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-6)
    lit = 0
    for angle in (0.0, 5.0, 12.0, 17.0, 19.0, 25.0, 47.0, 70.0):
        theta = np.radians(angle)
        local = np.array([np.sin(theta) * 0.6, np.sin(theta) * 0.8, np.cos(theta)])
        point = rotation @ (2.0 * local) + mine.to_world[:3, 3]
        _, weight = light_at(reference, tuple(point))
        falloff = (mine.cutoff_angle - angle) / (mine.cutoff_angle - mine.beam_width)
        expected = np.array(mine.intensity) * np.clip(falloff, 0.0, 1.0) / 4.0
        np.testing.assert_allclose(weight, expected, atol=1e-4)
        lit += weight.max() > 0.0
    assert lit >= 3


@pytest.mark.parametrize(
    "content",
    [
        "",
        '<transform name="to_world"><rotate x="1" angle="50"/></transform>',
        '<vector name="direction" x="1" y="2" z="-3"/>',
        '<vector name="direction" x="0" y="0" z="1e-30"/>',
        COLOUR.format("irradiance"),
    ],
)
def test_directional_light_is_that_of_mitsuba(content: str) -> None:
    mine, reference = both("directional", content)
    assert isinstance(mine, DirectionalLight)
    assert np.linalg.norm(mine.direction) == pytest.approx(1.0)
    assert mine.irradiance == tuple(parameter(reference, "irradiance.value"))
    if "1e-30" not in content:  # Mitsuba's square of it is 0
        toward, weight = light_at(reference, (0.1, 0.2, 0.3))
        np.testing.assert_allclose(toward, -np.array(mine.direction), atol=1e-6)
        np.testing.assert_allclose(weight, mine.irradiance, rtol=1e-5)


@pytest.mark.parametrize("content", ["", COLOUR.format("radiance"), MOVED])
def test_constant_light_is_that_of_mitsuba(content: str) -> None:
    mine, reference = both("constant", content)
    assert isinstance(mine, ConstantLight)
    assert mine.radiance == tuple(parameter(reference, "radiance.value"))


@pytest.mark.parametrize("plugin", ["rectangle", "disk", "sphere", "cylinder", "cube"])
@pytest.mark.parametrize("content", ["", COLOUR.format("radiance")])
def test_area_light_is_that_of_mitsuba(plugin: str, content: str) -> None:
    text = f'<shape type="{plugin}"><emitter type="area">{content}</emitter></shape>'
    scene = ours(text)
    reference = theirs(text).shapes()[0].emitter()
    assert scene.shapes[0].radiance == tuple(parameter(reference, "radiance.value"))
    assert scene.emitters == ()


def test_emitters_keep_the_order_of_the_file() -> None:
    text = (
        '<emitter type="point"/><emitter type="constant"/><shape type="sphere"/>'
        '<emitter type="directional"/>'
    )
    kinds = [type(emitter) for emitter in ours(text).emitters]
    assert kinds == [PointLight, ConstantLight, DirectionalLight]


# -------------------------------------------------------------------- errors


@pytest.mark.parametrize(
    ("plugin", "content", "message"),
    [
        (
            "moon",
            "",
            "supported emitter plugins: point, spot, directional, constant, envmap, "
            "sunsky, projector, area",
        ),
        ("point", props(power=1.0), 'has no property "power"; supported: posit'),
        (
            "point",
            tag("point", position="1") + MOVED,
            'property "position": found a value together with "to_world", expected one of',
        ),
        ("point", props(position=1.0), "of type float, expected point or vect"),
        ("directional", tag("vector", direction="1") + MOVED, 'together with "to_world"'),
        ("constant", props(radiance="x"), "a value of type string"),
        (
            "point",
            '<texture name="intensity" type="checkerboard"/>',
            'texture "checkerboard", which varies over the surface, expected one colour',
        ),
    ],
)
def test_emitters_that_are_wrong(plugin: str, content: str, message: str) -> None:
    text = f'<emitter type="{plugin}">\n{content}</emitter>'
    assert error_of(text).startswith(("<string>:2: ", "<string>:3: "))
    assert message in error_of(text)
    assert mitsuba_refuses(text)


STRETCHED = '<transform name="to_world"><scale x="2"/></transform>'


@pytest.mark.parametrize(
    ("plugin", "content", "message"),
    [
        ("area", "", 'emitter "area" belongs inside of a <shape>'),
        ("directional", tag("vector", direction="0"), "found the zero vector, expected"),
        (
            "directional",
            to_world('<scale value="3"/>'),
            "a transform that stretches z, expected a rotation",
        ),
        ("spot", STRETCHED, "a transform that distorts the cone"),
        ("spot", props(cutoff_angle=0.0), "found 0, expected above 0 and at mo"),
        ("spot", props(beam_width=30.0), "found 30, expected at least 0 and at"),
        (
            "spot",
            '<float name="cutoff_angle" value="95"/>'
            '<texture name="texture" type="checkerboard"/>',
            "found 95 with a texture, expected less than 90",
        ),
        ("point", props(sampling_weight=2.0), "found 2, expected 1: lights are"),
        ("point", '<transform name="to_world"><scale value="0"/></transform>', "singular"),
    ],
)
def test_emitters_that_only_we_refuse(plugin: str, content: str, message: str) -> None:
    """Mitsuba lets these through, with NaN or another meaning than the file's."""
    found = error_of(f'<emitter type="{plugin}">\n{content}</emitter>')
    assert found.startswith(("<string>:2: ", "<string>:3: "))
    assert message in found


def test_area_light_may_not_have_a_transform_or_a_board_of_textures() -> None:
    text = '<shape type="sphere"><emitter type="area">\n{}</emitter></shape>'
    message = error_of(text.format(MOVED))
    assert message == (
        '<string>:3: emitter "area", property "to_world": found a transform, expected '
        "none: "
        "the light is where its shape is"
    )
    assert mitsuba_refuses(text.format(MOVED))
    inner = '<texture name="color0" type="checkerboard"/>'
    board = f'<texture name="radiance" type="checkerboard">{inner}</texture>'
    assert "found a checkerboard of textures" in error_of(text.format(board))
