"""Implicit surfaces: every root, no root twice, against closed forms and dense sampling.

Mitsuba has no such shape. What is compared with: roots of polynomials by NumPy (companion
matrices), a sphere of the renderer's, and g itself, sampled densely in double precision.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scene_file_samples import error_of, ours
from scene_xml import element, props, tag, to_world

import renderer
from renderer.kernels.jit import entry_kernel
from renderer.kernels.lanes.vectors import vec3
from renderer.plugins.shapes.implicit import first_root
from renderer.plugins.shapes.intervals import Interval, Steps, along_line
from renderer.scene_file import read_dict
from renderer.scene_file.objects.expressions import (
    ExpressionError,
    parse_expression,
    trace_function,
)

SPHERE = "x^2 + y^2 + z^2 - 1"
TORUS = "(x^2 + y^2 + z^2 + 0.64 - 0.09)^2 - 4*0.64*(x^2 + y^2)"
HEART = "(x^2 + 9/4*y^2 + z^2 - 1)^3 - x^2*z^3 - 9/80*y^2*z^3"
GYROID = (
    "max(abs(sin(4*x)*cos(4*y) + sin(4*y)*cos(4*z) + sin(4*z)*cos(4*x)) - 0.3,"
    " x^2 + y^2 + z^2 - 1.4)"
)
FUNCTIONS = {"sphere": SPHERE, "torus": TORUS, "heart": HEART, "gyroid": GYROID}


@entry_kernel
def run_first_root(operations, operands, origin, direction, near, far, t, count):
    program = Steps(operations, operands, 0, operations.size)
    for i in range(t.size):
        o = vec3(origin[i, 0], origin[i, 1], origin[i, 2])
        d = vec3(direction[i, 0], direction[i, 1], direction[i, 2])
        t[i], count[i] = first_root(program, o, d, near[i], far)


@entry_kernel
def run_along_line(operations, operands, origin, direction, low, high, out):
    program = Steps(operations, operands, 0, operations.size)
    o = vec3(origin[0], origin[1], origin[2])
    d = vec3(direction[0], direction[1], direction[2])
    for i in range(low.size):
        value, slope = along_line(program, o, d, Interval(low[i], high[i]))
        out[0, i], out[1, i], out[2, i], out[3, i] = (
            value.low,
            value.high,
            slope.low,
            slope.high,
        )


def roots(text, origin, direction, near=0.0, far=10.0):
    """Return t of the first root of each ray, and how often g was evaluated."""
    program, n = parse_expression(text), len(origin)
    t, count = np.zeros(n), np.zeros(n, np.int64)
    near = np.broadcast_to(np.float64(near), n).copy()
    run_first_root(
        program.operations, program.operands, origin, direction, near, far, t, count
    )
    return t, count


def evaluate(text, p):
    """Return g of points (..., 3), by NumPy."""
    names = {n: getattr(np, n) for n in ("sin", "cos", "sqrt", "exp", "abs", "pi")}
    names |= {
        "max": lambda *terms: np.maximum.reduce(terms),
        "min": lambda *terms: np.minimum.reduce(terms),
    }
    names |= dict(zip("xyz", np.moveaxis(p, -1, 0), strict=True))
    return eval(text.replace("^", "**"), names)


def rays(n, seed, size=0.7):
    """Return rays from a sphere of radius 3 through a ball in the middle."""
    rng = np.random.default_rng(seed)
    origin = rng.normal(size=(n, 3))
    origin *= 3.0 / np.linalg.norm(origin, axis=1, keepdims=True)
    direction = rng.normal(size=(n, 3)) * size - origin
    return origin, direction / np.linalg.norm(direction, axis=1, keepdims=True)


# ------------------------------------------------------------------------------- roots


@pytest.mark.parametrize("inside", [False, True])
def test_a_torus_has_the_roots_of_its_quartic(inside):
    """All roots along each ray, one after the other, from outside and from within."""
    origin, direction = rays(200, 2)
    if inside:
        turn = np.linspace(0, 2 * np.pi, 200)
        origin = 0.8 * np.stack([np.cos(turn), np.sin(turn), 0.1 * np.sin(turn)], axis=1)
    # x = o + t d in (|x|^2 + c)^2 - 4 R^2 (x^2 + y^2): a polynomial of degree 4
    a, b = 0.64 - 0.09, 4 * 0.64
    for o, d in zip(origin, direction, strict=True):
        square = np.poly1d([d @ d, 2 * o @ d, o @ o + a])
        across = np.poly1d([d[:2] @ d[:2], 2 * o[:2] @ d[:2], o[:2] @ o[:2]])
        expected = (square * square - b * across).roots
        expected = np.sort(expected[abs(expected.imag) < 1e-9].real)
        if len(expected) > 1 and np.diff(expected).min() < 1e-3:
            continue  # nearly double ones: NumPy itself knows half of the digits
        expected = expected[expected > 1e-6]
        found, near = [], 1e-7
        while True:
            (t,), _ = roots(TORUS, o[None], d[None], near)
            if not np.isfinite(t):
                break
            found.append(t)
            near = t + 1e-7
        np.testing.assert_allclose(found, expected, rtol=1e-9)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_no_first_root_is_missed_and_none_invented(name):
    """Against the first change of sign among 5,000 places along each ray."""
    text = FUNCTIONS[name]
    origin, direction = rays(400, 3)
    t, count = roots(text, origin, direction)
    places = np.linspace(0.0, 6.0, 5001)
    g = evaluate(text, origin[:, None] + places[:, None] * direction[:, None])
    changes = np.diff(np.sign(g), axis=1) != 0
    first = np.where(changes.any(axis=1), places[changes.argmax(axis=1)], np.inf)
    hit = np.isfinite(t)
    assert (hit | ~np.isfinite(first)).all()  # none is missed
    assert (t[np.isfinite(first)] <= first[np.isfinite(first)] + 1.21e-3).all()
    points = origin[hit] + t[hit, None] * direction[hit]
    assert abs(evaluate(text, points)).max() < 1e-12  # each is one
    # sampled places can overlook two roots next to each other, and then we are earlier
    assert (~np.isfinite(first[hit])).mean() < 0.01
    assert count.mean() < 60
    assert count.max() < 1000


def test_rays_that_graze_a_sphere():
    """At a distance of 1 -+ e from the centre: met inside, missed outside, e >= 1e-9."""
    for e in (1e-3, 1e-6, 1e-9):
        for side, meets in ((-1, True), (1, False)):
            o = np.array([[1.0 + side * e, 0.0, -3.0]])
            (t,), (count,) = roots(SPHERE, o, np.array([[0.0, 0.0, 1.0]]))
            assert np.isfinite(t) == meets
            assert count < 200
            if meets:
                assert t == pytest.approx(3.0 - np.sqrt(2 * e - e * e), abs=1e-7)


def test_a_double_root_counts():
    """A surface that touches the ray, or has no inside: g = (z - 1)^2."""
    o, d = np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]])
    for text in ("(z - 1)^2", "abs(z - 1)", "(z - 1)^3"):
        (t,), (count,) = roots(text, o, d)
        assert t == pytest.approx(1.0, abs=1e-4)
        assert count < 500


def test_a_pole_is_no_root():
    o, d = np.array([[0.1, 0.2, -2.0]]), np.array([[0.0, 0.0, 1.0]])
    assert np.isinf(roots("1 / z", o, d)[0])
    assert roots("1 / z - 0.5", o, d)[0] == pytest.approx(4.0)
    assert roots("1 / (x^2 + y^2 + z^2) - 4", o, d)[0] == pytest.approx(2 - np.sqrt(0.2))


EXPRESSIONS = [
    *FUNCTIONS.values(),
    "sin(3*x) / (1.5 + cos(y)) - exp(-z^2)",
    "sqrt(x^2 + y^2) - abs(z) + min(x, y, z) - max(x, 2*y)",
    "x^3 - 2*y^-2 + z^5 / (0.5 - x)",
]


@settings(max_examples=40, deadline=None)
@given(
    st.sampled_from(EXPRESSIONS),
    st.lists(st.floats(-3, 3), min_size=6, max_size=6),
    st.floats(-4, 4),
    st.floats(1e-6, 4),
)
def test_an_interval_holds_all_values_and_slopes(text, line, low, width):
    """Values at 500 places, and slopes between neighbours: inside, and NaN never."""
    program = parse_expression(text)
    o, d = np.array(line[:3]), np.array(line[3:])
    out = np.zeros((4, 1))
    ends = np.array([low]), np.array([low + width])
    run_along_line(program.operations, program.operands, o, d, *ends, out)
    assert not np.isnan(out).any()
    t = np.linspace(low, low + width, 500)
    with np.errstate(all="ignore"):
        g = evaluate(text, o + t[:, None] * d)
        slope = np.diff(g) / np.diff(t)
        rounding = 1e-13 * (1 + abs(g).max()) / (t[1] - t[0])
    g, slope = g[np.isfinite(g)], slope[np.isfinite(slope)]
    assert (g >= out[0]).all()
    assert (g <= out[1]).all()
    assert (slope >= out[2] - rounding).all()
    assert (slope <= out[3] + rounding).all()


@pytest.mark.parametrize(
    ("text", "slope"), [("sin(x)", np.cos), ("cos(x)", lambda x: -np.sin(x))]
)
def test_the_range_of_a_wave_is_that_of_its_ends_and_peaks(text, slope):
    """To 1e-13, and never too narrow: over 500 intervals up to more than a period wide.

    So is the range of its slope.
    """
    rng = np.random.default_rng(5)
    low = rng.uniform(-8, 8, 500)
    high = low + rng.uniform(0, 7, 500)
    program, out = parse_expression(text), np.zeros((4, 500))
    line = np.zeros(3), np.array([1.0, 0.0, 0.0])
    run_along_line(program.operations, program.operands, *line, low, high, out)
    peaks = np.arange(-16, 17) * np.pi / 2  # of both, and where they are 0
    inside = np.clip(peaks, low[:, None], high[:, None])  # an end, where it is outside
    g = evaluate(text, np.stack([inside, 0 * inside, 0 * inside], axis=-1))
    for values, (low, high) in ((g, out[:2]), (slope(inside), out[2:])):
        for bound, exact, side in (
            (low, values.min(axis=1), -1),
            (high, values.max(axis=1), 1),
        ):
            assert (side * (bound - exact) >= 0.0).all()
            np.testing.assert_allclose(bound, exact, rtol=0, atol=1e-13)


# ------------------------------------------------------------------------------ pictures


def scene(shape, **more):
    to_world = np.diag([-1.0, 1.0, -1.0, 1.0])
    to_world[2, 3] = 4.0
    film = {"type": "hdrfilm", "width": 24, "height": 24, "rfilter": {"type": "box"}}
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 4},
        "sensor": {"type": "perspective", "to_world": to_world, "fov": 40.0, "film": film},
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": 0.3}},
        "lamp": {
            "type": "point",
            "position": [2, 3, 4],
            "intensity": {"type": "rgb", "value": 20.0},
        },
        "shape": shape,
        **more,
    }


def picture(content, **options):
    return renderer.render(renderer.load_dict(content), spp=4, **options).pixels


STRETCHED = np.array([[0.5, 0, 0, 0.1], [0, 0.4, 0, 0], [0, 0, 0.5, 0], [0, 0, 0, 1.0]])


def test_a_sphere_is_the_sphere():
    """Pixel by pixel, the same random numbers: moved by to_world as well."""
    moved = 0.5 * np.eye(4) + np.diag([0, 0, 0, 0.5])
    moved[0, 3] = 0.1
    for matrix in (np.eye(4), moved):
        place = {"to_world": matrix}
        found = picture(scene({"type": "implicit", "expression": SPHERE, **place}))
        expected = picture(scene({"type": "sphere", **place}))
        np.testing.assert_allclose(found, expected, rtol=2e-5, atol=2e-6)


def test_bumps_stay_off_it():
    """It has no u and v: a bump map around its BSDF changes nothing.

    A bump map anywhere in the scene asks all shapes for dp/du and dp/dv.
    """
    noiseless = {
        "integrator": {"type": "direct"},
        "sky": {"type": "point", "position": [-2, 3, 4]},
    }
    image = np.random.default_rng(1).random((4, 4, 1)).astype(np.float32)
    heights = {"type": "bitmap", "data": image, "raw": True}
    bumps = {"type": "bumpmap", "h": heights, "nested": {"type": "diffuse"}}
    place = {"type": "implicit", "expression": SPHERE}
    found = picture(scene({**place, "bsdf": bumps}, **noiseless))
    expected = picture(scene({**place, "bsdf": {"type": "diffuse"}}, **noiseless))
    assert expected.max() > 0.1
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-6)


def test_normals_go_by_the_inverse_transpose():
    """An ellipsoid by its equation in the world, and a ball that to_world stretches."""
    text = "((x - 0.1) / 0.5)^2 + (y / 0.4)^2 + (z / 0.5)^2 - 1"
    stretched = {"type": "implicit", "expression": SPHERE, "to_world": STRETCHED}
    found, expected = (
        picture(scene(stretched)),
        picture(scene({"type": "implicit", "expression": text})),
    )
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5)


@pytest.mark.slow
def test_every_structure_and_an_instance_show_the_same():
    """Brute force, trees, and a copy of a group; an ellipsoid, whose normals turn."""
    torus = {"type": "implicit", "expression": TORUS, "bounds_min": [-1.2, -1.2, -0.4]}
    torus["bounds_max"] = [1.2, 1.2, 0.4]
    expected = picture(scene({**torus, "to_world": STRETCHED}))
    for accel in ("brute", "wide", "bvh-median", "kd-sah", "grid"):
        found = picture(scene({**torus, "to_world": STRETCHED}), accel=accel)
        assert np.array_equal(found, expected)
    group = {"type": "shapegroup", "id": "g", "torus": torus}
    copy = {"type": "instance", "to_world": STRETCHED, "of": {"type": "ref", "id": "g"}}
    np.testing.assert_allclose(picture(scene(copy, g=group)), expected, atol=1e-4)


def test_the_box_cuts_and_flip_normals_turns():
    """Half a ball is open: from its open side one sees the inside, black if one-sided."""
    half = {"type": "implicit", "expression": SPHERE, "bounds_max": [1, 1, 0]}
    black = picture(scene(half, sky={"type": "constant", "radiance": 0.0}))
    assert not black.any()
    turned = picture(scene({**half, "flip_normals": True}))
    assert turned[12, 12].min() > 0.1


def test_a_python_function_is_the_expression():
    def heart(x, y, z):
        return (x**2 + 9 / 4 * y**2 + z**2 - 1) ** 3 - x**2 * z**3 - 9 / 80 * y**2 * z**3

    traced, parsed = trace_function(heart), parse_expression(HEART)
    assert np.array_equal(traced.operations, parsed.operations)
    assert np.array_equal(traced.operands, parsed.operands)
    content = scene({"type": "implicit", "function": heart})
    assert read_dict(content).shapes[0].program.text == "heart"

    def waves(x, y, z):
        return np.maximum(np.sin(2.0 * x) - np.float64(0.5), np.abs(y)) + min_of(z)

    def min_of(z):
        return np.minimum(z, np.sqrt(z)) - np.exp(-z)

    text = "max(sin(2*x) - 0.5, abs(y)) + (min(z, sqrt(z)) - exp(-z))"
    traced, parsed = trace_function(waves), parse_expression(text)
    assert np.array_equal(traced.operations, parsed.operations)


# -------------------------------------------------------------------------------- errors


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            "",
            'property "expression": found nothing, expected an "expression" of x, y and z',
        ),
        (props(expression=""), "it is no expression"),
        (props(expression="x +"), "it is no expression: invalid syntax"),
        (props(expression="w + 1"), "`w` is not possible; possible: num"),
        (props(expression="x.real"), "`x.real` is not possible"),
        (props(expression="__import__(1)"), "is not possible; possible"),
        (props(expression="(lambda: 1)()"), "is not possible; possible"),
        (props(expression="[x][0]"), "`[x][0]` is not possible"),
        (props(expression="2(x)"), "`2(x)` is not possible"),
        (props(expression="sin(x, y)"), "`sin(x, y)` is not possible"),
        (props(expression="x^0.5"), "an exponent must be an integer from"),
        (props(expression="x^y"), "an exponent must be an integer"),
        (props(expression="x^99"), "an integer from -64 to 64"),
        (props(expression="x + 1e999"), "it has the constant inf"),
        (props(expression="x if y else z"), "is not possible"),
        (props(expression="True"), "`True` is not possible"),
        (props(expression=1.0), "found a value of type float, expected str"),
        (props(function="x"), "found a value of type string, expected fu"),
        (
            tag("point", bounds_min="2, 0, 0") + props(expression="x"),
            "found a box from (2.0, 0.0, 0.0) to (1.0, 1.0, 1.0), expected each coordinate",
        ),
        (
            element("emitter", "area") + props(expression="x"),
            "cannot emit: its area is not known",
        ),
        (props(expression="x", radius=1.0), 'has no property "radius"; supported: <bsdf>'),
        (
            to_world('<scale value="1e19"/>') + props(expression="x"),
            "what makes the shape reach farther than 1e+18",
        ),
    ],
)
def test_what_is_wrong_is_one_line(content, message):
    assert message in error_of(f'<shape type="implicit">{content}</shape>')


def test_too_much_is_refused():
    deep = "(x + " * 70 + "x" + ")" * 70
    with pytest.raises(ExpressionError, match="71 numbers wait for others; possible"):
        parse_expression(deep)
    with pytest.raises(ExpressionError):  # Python's own words, of parentheses
        parse_expression("(" * 5000 + "x" + ")" * 5000)
    with pytest.raises(ExpressionError, match="it is nested too deep"):
        parse_expression("+".join("x" * 3000))
    with pytest.raises(ExpressionError, match="it has more than 4096 operations"):
        trace_function(lambda x, y, z: sum([x] * 3000, y))


def raises(x, y, z):
    raise ZeroDivisionError("by hand")


def branches(x, y, z):
    return x if x > 0 else y


def returns_nan(x, y, z):
    return x + float("nan")


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (raises, "raises raises ZeroDivisionError: by hand"),
        (branches, "branches raises TypeError"),
        (returns_nan, "it has the constant nan"),
        (lambda x, y: x, "cannot be called with x, y, z"),
        (lambda x, y, z: "x", "it uses a str as a number"),
        (lambda x, y, z: np.tan(x), "np.tan is not possible; possible: numbers"),
        (lambda x, y, z: x and y, "it compares what is not yet a number"),
    ],
)
def test_a_function_that_cannot_be_used_is_one_line(function, message):
    with pytest.raises(renderer.SceneError, match=message) as found:
        read_dict(scene({"type": "implicit", "function": function}))
    assert "\n" not in str(found.value)


def test_the_harness_says_that_the_reference_has_no_such_shape(tmp_path):
    from mitsuba_ref.reference.edited_scene import load_edited_scene
    from mitsuba_ref.reference.variant import load_mitsuba

    load_mitsuba()
    path = tmp_path / "scene.xml"
    shape = '<shape type="implicit"><string name="expression" value="x"/></shape>'
    path.write_text(f'<scene version="3.0.0"><sensor type="perspective"/>{shape}</scene>')
    assert ours(shape).shapes[0].program.text == "x"
    with pytest.raises(RuntimeError, match="the reference has no such shape"):
        load_edited_scene(path, {})
