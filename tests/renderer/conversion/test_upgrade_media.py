"""`lightproof upgrade`: media, whose numbers, grids and boundaries have changed."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from renderer.conversion.old_mitsuba import upgraded
from renderer.conversion.upgrade_record import APPROXIMATED, DROPPED, LEFT
from renderer.scene_file import read_file

BALL = '<shape type="sphere">{}</shape>'
SMOKE = """<medium type="heterogeneous" id="smoke">
	<string name="method" value="woodcock"/>
	<volume name="density" type="gridvolume">
		<string name="filename" value="smoke.vol"/>
	</volume>
	<volume name="albedo" type="constvolume"><float name="value" value="0.9"/></volume>
	<float name="scale" value="100"/><float name="stepSize" value="0.1"/>
</medium>"""


def upgrade(folder, body, integrator="volpath_simple"):
    """Return the new scene and the changes."""
    text = (
        f'<scene version="0.5.0"><integrator type="{integrator}"/>'
        f'<sensor type="perspective"/>{body}</scene>'
    )
    (folder / "old.xml").write_text(text, encoding="utf-8")
    content, changes = upgraded(folder / "old.xml")
    (folder / "new.xml").write_bytes(content)
    return read_file(folder / "new.xml"), changes


def medium(inside):
    return BALL.format(f'<medium name="interior" type="homogeneous">{inside}</medium>')


@pytest.mark.parametrize(
    ("inside", "sigma_t", "albedo"),
    [
        (
            '<rgb name="sigmaA" value="1 0.5 0"/><spectrum name="sigmaS" value="1, 2, 0"/>',
            (2.0, 2.5, 0.0),
            (0.5, 0.8, 0.0),
        ),
        (
            '<spectrum name="sigmaS" value="0.25"/><spectrum name="sigmaA" value="0"/>',
            (0.25, 0.25, 0.25),
            (1.0, 1.0, 1.0),
        ),
        # what is left out is that of skin
        (
            '<rgb name="sigmaS" value="0"/>',
            (3.2, 17.0, 48.0),
            (0.0, 0.0, 0.0),
        ),
        (
            '<rgb name="sigmaT" value="3 2 1"/><rgb name="albedo" value="0.1 0.2 0.3"/>',
            (3.0, 2.0, 1.0),
            (0.1, 0.2, 0.3),
        ),
        (
            '<float name="sigmaT" value="3"/><spectrum name="albedo" value="0.5"/>',
            (3.0, 3.0, 3.0),
            (0.5, 0.5, 0.5),
        ),
    ],
)
def test_scattering_and_absorption_are_extinction_and_albedo(
    tmp_path, inside, sigma_t, albedo
):
    """Extinction is their sum, albedo the share of scattering in it; both may be 0."""
    scene, changes = upgrade(tmp_path, medium(f'{inside}<float name="scale" value="2"/>'))
    found = scene.shapes[0].interior
    np.testing.assert_allclose(found.sigma_t.rgb, sigma_t, rtol=1e-5)
    np.testing.assert_allclose(found.albedo.rgb, albedo, rtol=1e-5)
    assert found.scale == 2.0
    assert LEFT not in {change.kind for change in changes}


@pytest.mark.parametrize(
    "inside",
    [
        '<string name="material" value="Coke"/>',
        '<spectrum name="sigmaS" value="400:1, 700:2"/>',
        '<rgb name="sigmaS" value="1"/><float name="g" value="0.5"/>',
    ],
)
def test_coefficients_that_are_no_three_numbers_are_left(tmp_path, inside):
    text = f'<scene version="0.5.0">{medium(inside)}</scene>'
    (tmp_path / "old.xml").write_text(text, encoding="utf-8")
    content, changes = upgraded(tmp_path / "old.xml")
    assert [change.kind for change in changes].count(LEFT) == 1
    assert b"sigma_t" not in content


def test_a_grid_lies_in_the_box_of_its_file(tmp_path):
    box = (-1.0, 0.0, 2.0, 3.0, 5.0, 4.0)
    header = struct.pack("<3sB5i6f", b"VOL", 3, 1, 2, 1, 1, 1, *box)
    (tmp_path / "smoke.vol").write_bytes(header + struct.pack("<2f", 0.5, 1.0))
    body = SMOKE + BALL.format('<ref name="interior" id="smoke"/>')
    scene, changes = upgrade(tmp_path, body)
    found = scene.shapes[0].interior
    np.testing.assert_array_equal(found.sigma_t.values.ravel(), (0.5, 1.0))
    corners = found.sigma_t.to_world @ np.array([[0, 0, 0, 1], [1, 1, 1, 1]]).T
    np.testing.assert_allclose(corners[:3].T.ravel(), box)
    assert (found.scale, found.albedo.rgb) == (100.0, (0.9, 0.9, 0.9))
    kinds = [change.kind for change in changes]
    assert (kinds.count(APPROXIMATED), kinds.count(DROPPED)) == (1, 2)


FOG = '<medium type="homogeneous" id="fog"><float name="sigmaT" value="1"/></medium>'
EDGE = '<ref name="exterior" id="fog"/>'


@pytest.mark.parametrize(
    ("inside", "plugin"),
    [
        (EDGE, "null"),
        (EDGE + '<bsdf type="dielectric"/>', "dielectric"),
        (EDGE + '<ref id="glass"/>', "dielectric"),
        (EDGE + '<emitter type="area"/>', "diffuse"),
        ("", "diffuse"),
    ],
)
def test_a_boundary_without_a_bsdf_lets_light_pass(tmp_path, inside, plugin):
    body = FOG + '<bsdf type="dielectric" id="glass"/>' + BALL.format(inside)
    scene, _ = upgrade(tmp_path, body)
    assert scene.shapes[0].bsdf.plugin == plugin


@pytest.mark.parametrize(("body", "new"), [(FOG, "volpath"), ("", "path")])
def test_a_bidirectional_method_becomes_the_one_that_sees_media(tmp_path, body, new):
    scene, _ = upgrade(tmp_path, body, "bdpt")
    assert scene.integrator.name == new


def test_a_mixture_of_two_phase_functions_is_a_blend(tmp_path):
    phase = """<phase type="mixturephase"><string name="weights" value="0.75, 0.25"/>
<phase type="isotropic"/><phase type="hg"/></phase>"""
    scene, _ = upgrade(tmp_path, medium(f'<float name="sigmaT" value="1"/>{phase}'))
    assert scene.shapes[0].interior.phase.weight == 0.25
