"""look_at, translate, rotate, scale: Mitsuba's matrices, for `load_dict`."""

from __future__ import annotations

import logging
import math
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import renderer
from renderer import SceneError, look_at, rotate, scale, translate

mi.set_variant("scalar_rgb")

numbers = st.floats(-100, 100, allow_subnormal=False)
vectors = st.tuples(numbers, numbers, numbers)
FUNCTIONS = {"look_at": look_at, "translate": translate, "rotate": rotate, "scale": scale}


def mitsubas(name: str, *arguments: Any) -> np.ndarray:
    return np.array(getattr(mi.ScalarTransform4f(), name)(*arguments).matrix, np.float64)


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("look_at", ([1, 2, 3], [0, 0, 0], [0, 1, 0])),
        ("look_at", ([0, 5, 0], [0, 0, 0], [0.1, 0, 20])),
        ("look_at", ([-3, 0.5, 2], [4, 0, -1], [0, 0, 1])),
        ("translate", ([1, -2, 3.5],)),
        ("rotate", ([1, 0, 0], 30)),
        ("rotate", ([0, 1, 0], -725.5)),
        ("rotate", ([0, 0.6, 0.8], 90)),
        ("scale", (2,)),
        ("scale", (-0.5,)),
        ("scale", ([2, 0.5, -1],)),
    ],
)
def test_the_matrix_is_that_of_mitsuba(name: str, arguments: tuple[Any, ...]) -> None:
    """Handedness, degrees and the order of arguments, in single precision."""
    ours = FUNCTIONS[name](*arguments)
    assert ours.shape == (4, 4) and ours.dtype == np.float64
    np.testing.assert_allclose(ours, mitsubas(name, *arguments), atol=2e-6, rtol=1e-6)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(vectors, vectors, vectors, numbers)
def test_any_product_is_that_of_mitsuba(v, axis, factors, angle) -> None:
    """Mitsuba's transforms multiply by `@` too, and the right one acts first."""
    length = math.hypot(*axis)
    axis = tuple(c / length for c in axis) if length > 1e-3 else (0.0, 0.0, 1.0)
    ours = translate(v) @ rotate(axis, angle) @ scale(factors)
    T = mi.ScalarTransform4f
    theirs = T().translate(v) @ T().rotate(axis, angle) @ T().scale(factors)
    np.testing.assert_allclose(ours, np.array(theirs.matrix), atol=1e-4, rtol=1e-5)


def test_what_the_arguments_may_be() -> None:
    """Lists, tuples, NumPy's and Mitsuba's vectors, by position or by name."""
    for make in (list, tuple, np.array, np.float32, mi.ScalarPoint3f):
        assert np.array_equal(translate(make([1, 2, 3])), translate([1, 2, 3]))
    named = look_at(origin=[1, 2, 3], target=[0, 0, 0], up=[0, 1, 0])
    assert np.array_equal(named, look_at([1, 2, 3], [0, 0, 0], [0, 1, 0]))
    assert np.array_equal(
        rotate(axis=(0, 1, 0), angle=np.float32(30)), rotate([0, 1, 0], 30)
    )
    assert np.array_equal(scale(v=np.int64(2)), np.diag([2.0, 2.0, 2.0, 1.0]))


def test_a_long_axis_distorts_as_in_mitsuba_and_the_log_says_so(caplog) -> None:
    with caplog.at_level(logging.WARNING, "renderer"):
        ours = rotate([0, 2, 0], 30)
    np.testing.assert_allclose(ours, mitsubas("rotate", [0, 2, 0], 30), atol=1e-6)
    assert "rotate: the axis has the length 2; Mitsuba does not normalize it" in caplog.text
    caplog.clear()
    rotate([0.577, 0.577, 0.577], 30)
    assert not caplog.text


NAN = float("nan")


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: look_at([0, 0, 5], [0, 0, 0], [0, 0, 2]), "up .0, 0, 2.: target must"),
        (lambda: look_at([0, 0, 5], [0, 0, 5], [0, 1, 0]), "no view from origin .0, 0, 5."),
        (lambda: look_at([0, 0, 5], [0, 0, 0], [0, 0, 0]), "up is 0; possible is a dir"),
        (lambda: look_at([0, 0], [0, 0, 0], [0, 1, 0]), "origin is .0, 0.; possible is th"),
        (lambda: look_at([0, 0, 5], [NAN, 0, 0], [0, 1, 0]), "target is .nan, 0, 0.;"),
        (lambda: look_at([0, 0, 5], [0, 0, 0], None), "up is None; possible is three"),
        (lambda: look_at([1e300, 0, 5], [-1e300, 0, 0], [0, 1, 0]), "there is no view"),
        (lambda: translate(2.0), "translate: v is 2.0; possible is three finite numbers"),
        (lambda: translate("1 2 3"), "v is '1 2 3'; possible is three finite numbers"),
        (lambda: translate([1, "2", 3]), "translate: v is .1, '2', 3.;"),
        (lambda: translate([[1, 2, 3]]), r"translate: v is \[\[1, 2, 3\]\];"),
        (lambda: translate([1, math.inf, 3]), "translate: v is .1, inf, 3.;"),
        (lambda: translate([True, False, True]), "translate: v is .True, False, True.;"),
        (lambda: translate([1, [2], 3]), r"v is \[1, \[2\], 3\];"),
        (lambda: rotate([0, 0, 0], 30), "rotate: the axis is 0; possible is a direction"),
        (lambda: rotate([0, 1, 0], [30]), r"angle is \[30\]; possible is a finite number"),
        (lambda: rotate([0, 1, 0], NAN), "rotate: angle is nan;"),
        (lambda: rotate(1, 30), "rotate: axis is 1; possible is three finite numbers"),
        (lambda: scale([1, 2]), r"scale: v is \[1, 2\]; possible is one finite number, or"),
        (lambda: scale(None), "scale: v is None;"),
        (lambda: scale(np.eye(40)), "scale: v is array.*\\.\\.\\.; possible"),
    ],
)
def test_what_is_wrong_is_one_line(call: Any, message: str) -> None:
    with pytest.raises(SceneError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_load_dict_takes_them_for_cameras_shapes_and_textures() -> None:
    """The same picture as with Mitsuba's own objects, which are taken too."""
    T = mi.ScalarTransform4f

    def picture(world, turned, uv):
        scene = renderer.load_dict(
            {
                "type": "scene",
                "integrator": {"type": "aov", "aovs": "uv:uv,a:albedo,p:position"},
                "sensor": {
                    "type": "perspective",
                    "to_world": world,
                    "film": {"type": "hdrfilm", "width": 9, "height": 7},
                },
                "wall": {
                    "type": "rectangle",
                    "to_world": turned,
                    "bsdf": {
                        "type": "diffuse",
                        "reflectance": {"type": "checkerboard", "to_uv": uv},
                    },
                },
            }
        )
        return renderer.render(scene, spp=1).aovs

    ours = picture(
        look_at([1, 2, 4], [0, 0, 0], [0, 1, 0]),
        translate([0, 0.5, 0]) @ rotate([0, 1, 0], 20) @ scale([1, 2, 1]),
        rotate([0, 0, 1], 30) @ translate([0.3, 0, 0]) @ scale(4),
    )
    theirs = picture(
        T().look_at([1, 2, 4], [0, 0, 0], [0, 1, 0]),
        T().translate([0, 0.5, 0]).rotate([0, 1, 0], 20).scale([1, 2, 1]),
        T().rotate([0, 0, 1], 30).translate([0.3, 0, 0]).scale(4),
    )
    assert ours["a"].min() < ours["a"].max()  # both colours of the checkerboard are seen
    for name, values in theirs.items():
        np.testing.assert_allclose(ours[name], values, atol=1e-5)


def test_a_flat_transform_is_refused_where_it_is_used() -> None:
    """`scale(0)` is a matrix, and none that a shape may have."""
    shape = {"type": "sphere", "to_world": scale(0)}
    with pytest.raises(SceneError, match=r"ball.*to_world.*singular"):
        renderer.load_dict({"type": "scene", "ball": shape})
