"""Transforms: the same matrices as Mitsuba makes, and no flattened space."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scene_file_samples import error_of, mitsuba_refuses, ours, theirs

from renderer.scene_file import transforms

# On a disk: it takes every affine transform, and Mitsuba shows its matrix.
DISK = '<shape type="disk"><transform name="to_world">{}</transform></shape>'

STEPS = {
    "translate": '<translate x="1" y="-2" z="3.5"/>',
    "translate in part": '<translate y="2"/>',
    "translate by value": '<translate value="1 2, 3"/>',
    "scale": '<scale x="2" y="0.5" z="-1"/>',
    "scale in part": '<scale z="3"/>',
    "scale by one value": '<scale value="2"/>',
    "rotate about x": '<rotate x="1" angle="30"/>',
    "rotate about a long axis": '<rotate x="1" y="2" z="-3" angle="-77"/>',
    "rotate by value": '<rotate value="0,0.5,0.5" angle="400"/>',
    "lookat": '<lookat origin="1 2 3" target="0,0,1" up="0 1 0"/>',
    "lookat without up": '<lookat origin="1,2,3" target="0.5,0.2,0.1"/>',
    "lookat with zero up": '<lookat origin="1,2,3" target="0.5,0.2,9" up="0 0 0"/>',
    "4 x 4 matrix": '<matrix value="1 2 0 4  0 1 3 5  -1 0 2 6  0 0 0 1"/>',
    "3 x 3 matrix": '<matrix value="1 2 0  0 1 3  -1 0 2"/>',
    "order": '<scale x="2"/><rotate z="1" angle="90"/><translate x="5"/>',
}


@pytest.mark.parametrize("steps", STEPS.values(), ids=STEPS)
def test_transform_is_the_matrix_of_mitsuba(steps: str) -> None:
    content = DISK.format(steps)
    expected = np.array(mi.traverse(theirs(content).shapes()[0])["to_world"].matrix)
    np.testing.assert_allclose(
        ours(content).shapes[0].to_world, expected, atol=2e-6, rtol=1e-6
    )


def test_axis_that_is_not_of_length_one_distorts_as_in_mitsuba() -> None:
    """Mitsuba 3.9.1 does not normalize it; the log says so."""
    scene = ours(DISK.format('<rotate x="1" y="1" angle="30"/>'))
    assert abs(np.linalg.det(scene.shapes[0].to_world) - 1.0) > 0.1
    assert "the axis of <rotate> has the length 1.414" in scene.warnings[0]
    assert ours(DISK.format('<rotate value=".577 .577 .577" angle="9"/>')).warnings == ()


numbers = st.floats(-100, 100, allow_subnormal=False)
vectors = st.tuples(numbers, numbers, numbers).filter(lambda v: max(map(abs, v)) > 1e-3)


step_texts = st.one_of(
    st.builds('<translate x="{:.4g}" y="{:.4g}"/>'.format, numbers, numbers),
    st.builds('<scale value="{:.4g}"/>'.format, st.floats(0.1, 10)),
    st.builds(
        '<rotate x="{:.4g}" y="1" angle="{:.4g}"/>'.format, st.floats(-1, 1), numbers
    ),
)


@given(steps=st.lists(step_texts, min_size=1, max_size=6))
@settings(max_examples=40, deadline=None)
def test_any_chain_of_steps_is_the_matrix_of_mitsuba(steps: list[str]) -> None:
    content = DISK.format("".join(steps))
    matrix = ours(content).shapes[0].to_world
    expected = np.array(mi.traverse(theirs(content).shapes()[0])["to_world"].matrix)
    np.testing.assert_allclose(
        matrix, expected, rtol=1e-5, atol=1e-5 * np.abs(matrix).max()
    )


@given(direction=vectors)
def test_z_to_is_a_rotation_onto_the_direction(direction: tuple[float, ...]) -> None:
    matrix = transforms.z_to(direction)[:3, :3]
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(matrix) == pytest.approx(1.0)
    np.testing.assert_allclose(
        matrix[:, 2], direction / np.linalg.norm(direction), atol=1e-12
    )


# -------------------------------------------------------------------- errors


@pytest.mark.parametrize(
    "steps",
    ['<scale value="0"/>', '<scale z="0"/>', '<matrix value="1 2 3  2 4 6  0 0 1"/>'],
)
@pytest.mark.parametrize("plugin", ["rectangle", "disk", "sphere", "cylinder", "cube"])
def test_singular_transform(plugin: str, steps: str) -> None:
    content = (
        f'<shape type="{plugin}">\n<transform name="to_world">{steps}</transform></shape>'
    )
    message = error_of(content)
    assert message.startswith(f'<string>:3: shape "{plugin}", property "to_world": found ')
    assert "singular" in message


@pytest.mark.parametrize("plugin", ["rectangle", "disk", "sphere", "cylinder", "cube"])
def test_a_transform_without_an_inverse_in_single_precision(plugin: str) -> None:
    """With a bump on it a RuntimeWarning: case 307457 of the soak's damaged files."""
    message = error_of(
        f'<shape type="{plugin}">\n<transform name="to_world"><scale value="1e-45"/>'
        "</transform></shape>"
    )
    assert message.startswith(f'<string>:3: shape "{plugin}", property "to_world": found ')
    assert "shrinks to less than 1e-38" in message


@pytest.mark.parametrize(
    "value",
    [
        "1e-37 1e-37 0 0  0 1e-39 0 0  0 0 1e-37 0  0 0 0 1",  # a shear: 1e39
        "1e-30 0 0 1e10  0 1e-30 0 0  0 0 1e-30 0  0 0 0 1",  # moved: 1e40
    ],
)
def test_an_inverse_may_be_too_large_with_columns_that_are_not_small(value: str) -> None:
    message = error_of(DISK.format(f'<matrix value="{value}"/>'))
    assert "its inverse leaves single precision" in message


def test_small_and_large_scales_are_not_singular() -> None:
    for factor in ("1e-6", "1e6"):
        ours(DISK.format(f'<scale value="{factor}"/>'))
    ours(DISK.format('<scale x="1e-9" y="1e9"/>'))


@pytest.mark.parametrize(
    ("steps", "message"),
    [
        ('<rotate angle="3"/>', "the axis of <rotate> is 0"),
        ('<rotate x="1"/>', '<rotate> lacks the attribute "angle"'),
        ('<lookat origin="0 0 0" target="0 0 0" up="0 1 0"/>', "<lookat> has no direction"),
        ('<lookat origin="0 0 0" target="0 0 1" up="0 0 1"/>', "<lookat> has no direction"),
        ('<lookat origin="0 0" target="0 0 1"/>', "2 numbers; expected 3"),
        (
            '<lookAt origin="0 0 0" target="0 0 1"/>',
            "unknown transform <lookAt>; supported: ",
        ),
        ('<matrix value="1 2 3 4"/>', "4 numbers; expected 9 or 16"),
        ('<translate x="1" w="2"/>', '<translate> has no attribute "w"; it takes: '),
        ('<scale value="2" x="1"/>', 'has "value" and "x"'),
        ('<scale value="2 3"/>', "2 numbers; expected 1 or 3"),
    ],
)
def test_steps_that_are_wrong(steps: str, message: str) -> None:
    assert error_of(DISK.format("\n" + steps)).startswith("<string>:3: ")
    assert message in error_of(DISK.format(steps))
    assert mitsuba_refuses(DISK.format(steps))


def test_projective_matrix_is_refused() -> None:
    content = DISK.format('<matrix value="1 0 0 0  0 1 0 0  0 0 1 0  0 0 0.5 1"/>')
    assert "last row is not 0 0 0 1" in error_of(content)


def test_transform_that_overflows() -> None:
    content = DISK.format('<scale value="1e38"/>' * 9)
    assert "not finite" in error_of(content)
