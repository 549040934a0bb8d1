"""Light sampling: closed forms of irradiance, densities, no light from behind.

Irradiance E is the mean of radiance times cosine over samples of a light, where radiance
already is divided by the density. Answers are those of the project's table of ground
truths (rows C, D, E, F, L).

Seeds are fixed. A limit of 4.5 standard errors has a false alarm rate of 7e-6 and finds
with 99 % what is 6.9 of them off. One is below 0.65 % of the answer in 36 of 46 comparisons
and below 3.7 % in 44; 0.01 below the wall of the sphere that shines inwards it is 19 and
61 %, which says little. `test_light_samplers.py` compares the densities themselves, and
finds a tilt of 3 %.
"""

from __future__ import annotations

import numpy as np
import pytest
from kernel_probes import (
    chi_square_z,
    float32,
    kernel_inputs,
    mean_z,
    nearest,
    unit,
)
from light_probes import AREA_SHAPES, OTHERS, SPACING, TILT, LightProbe
from scene_file_samples import mi

from renderer.scene.light_tables import alias_table

N = 1 << 16
SIGMA = 4.5
L = np.array([2.0, 1.0, 0.5])


# ------------------------------------------------------------------------ the scene


VALUE = {"point": "intensity", "spot": "intensity", "directional": "irradiance"}
NAMES = [*AREA_SHAPES, *OTHERS]


def rgb():
    return {"type": "rgb", "value": list(L)}


def others():
    """Emitters as Mitsuba's `load_dict` takes them too, but for the transform."""
    return {k: {**e, VALUE.get(k, "radiance"): rgb()} for k, e in OTHERS.items()}


class Setup(LightProbe):
    """The lights, and a scene to trace rays in."""

    def __init__(self):
        super().__init__(AREA_SHAPES, others(), tuple(L))
        self.tracing = kernel_inputs(self.scene)

    def sample(self, name, position, random=None):
        """(wi, radiance, distance, pdf) for one position or N of them."""
        if random is None:
            random = np.random.default_rng(NAMES.index(name)).random((3, N))
        return super().sample(name, position, random)

    def density_at(self, name, position, found, cosine):
        """The density of directions that hit the light."""
        return self.density(name, position, found.prim, found.t, np.abs(cosine))

    def irradiance_z(self, name, position, normal, expected):
        """Sigma between the estimate of E / L and the expected value."""
        wi, radiance, _, _ = self.sample(name, position)
        assert np.isfinite(radiance).all(), f"{name} gives radiance that is not finite"
        contribution = radiance * np.maximum(wi @ unit(normal), 0)[:, None]
        np.testing.assert_allclose(contribution[:, 0], 2 * contribution[:, 1], rtol=1e-6)
        per_l = contribution[:, 1]
        if per_l.std() < 1e-6 * per_l.mean():  # no noise at all
            return 0.0 if per_l.mean() == pytest.approx(expected, rel=3e-6) else np.inf
        return mean_z(per_l, expected)


@pytest.fixture(scope="module")
def setup():
    return Setup()


def center(name):
    return AREA_SHAPES[name]["to_world"][:3, 3]


def beside(name, *where):
    """A point given relative to a light."""
    return center(name) + np.array(where, float)


# --------------------------------------------------------- lights without an area


def test_spot_light(setup):
    """Full within the beam, linear in angle to the cutoff, dark beyond."""
    angles = np.radians([0, 10, 24.9, 25.1, 30, 35, 39.9, 40.1, 60, 120, 180])
    local = np.stack((np.sin(angles), 0 * angles, np.cos(angles)), 1) * 3
    where = local @ TILT.T + [2, 0, 0]
    _, radiance, distance, pdf = setup.sample("spot", where, np.zeros((3, len(where))))
    falloff = np.clip((np.radians(40) - angles) / np.radians(15), 0, 1)
    np.testing.assert_allclose(radiance, falloff[:, None] * L / 9, atol=2e-6)
    np.testing.assert_allclose(distance, 3, rtol=1e-6)
    np.testing.assert_array_equal(pdf, 0)


def test_directional_light(setup):
    """The same from everywhere, against its direction, from beyond the scene."""
    where = np.array([[0.0, 0, 0], [400, 1, 2]])
    wi, radiance, distance, pdf = setup.sample("directional", where, np.zeros((3, 2)))
    np.testing.assert_allclose(wi, np.tile(-unit([1.0, 2, -3]), (2, 1)), atol=1e-7)
    np.testing.assert_array_equal(radiance, [L, L])
    np.testing.assert_array_equal(pdf, 0)
    assert distance.min() > 8 * SPACING + 2


def for_mitsuba(emitter):
    matrix = emitter.get("to_world")
    return (
        emitter if matrix is None else {**emitter, "to_world": mi.ScalarTransform4f(matrix)}
    )


@pytest.mark.parametrize("name", ["point", "spot", "directional"])
def test_delta_lights_against_mitsuba(setup, name):
    """Direction and weight of `sample_direction`."""
    scene = mi.load_dict({"type": "scene", "light": for_mitsuba(others()[name])})
    where = np.random.default_rng(1).uniform(-4, 4, (500, 3)).astype(np.float32)
    wi, radiance, _, _ = setup.sample(name, where, np.zeros((3, 500)))
    it = mi.SurfaceInteraction3f()
    for k, p in enumerate(where.tolist()):
        it.p = p
        ds, weight = scene.emitters()[0].sample_direction(it, [0.5, 0.5])
        np.testing.assert_allclose(wi[k], ds.d, atol=1e-6)
        np.testing.assert_allclose(radiance[k], weight, atol=3e-6, rtol=3e-5)


def test_constant_environment(setup):
    """E = pi L whatever the normal (row L), uniform over the sphere, density 1 / (4 pi)."""
    wi, radiance, distance, pdf = setup.sample("constant", [1.0, 2, 3])
    np.testing.assert_allclose(pdf, 1 / (4 * np.pi), rtol=1e-6)
    np.testing.assert_allclose(radiance * pdf[:, None], np.tile(L, (N, 1)), rtol=1e-6)
    assert distance.min() > 8 * SPACING + 2
    for normal in ([0, 0, 1], [1, 0, 0], [1, -2, 0.5]):
        assert abs(setup.irradiance_z("constant", [1.0, 2, 3], normal, np.pi)) < SIGMA
    assert chi_square_z(np.histogram(wi[:, 2], 64, (-1, 1))[0]) < SIGMA


# ---------------------------------------------------------------- irradiance, area lights


@pytest.mark.parametrize(
    ("distance", "cosine"), [(3.0, 1.0), (3.0, 0.8), (1.2, 1.0), (100.0, 0.5)]
)
def test_sphere_light(setup, distance, cosine):
    """E = pi L (R / d)^2 cos while all of it is above the horizon (row C)."""
    away = unit([1.0, 2.0, -2.0])
    position = float32(center("sphere") + distance * away)
    exact = np.linalg.norm(position - center("sphere"))
    towards = -away
    side = unit(np.cross(towards, [0, 0, 1.0]))
    normal = cosine * towards + np.sqrt(1 - cosine**2) * side
    expected = np.pi / exact**2 * cosine
    # 100 away its coordinates are rounded by 1e-5, a third of a sigma
    assert abs(setup.irradiance_z("sphere", position, normal, expected)) < SIGMA


@pytest.mark.parametrize("height", [1e-2, 1e-3, 1e-4, 1e-6])
def test_just_above_a_sphere_light(setup, height):
    """The cone opens to a half space: still E = pi L (R / d)^2, no NaN."""
    position = float32(beside("sphere", 0, 0, 1 + height))
    d = position[2].astype(float)
    assert abs(setup.irradiance_z("sphere", position, [0, 0, -1], np.pi / d**2)) < SIGMA


@pytest.mark.parametrize("inside", [(0, 0, 0), (0.5, 0, 0), (0, -0.6, 0.6), (0, 0, 0.99)])
def test_inside_a_sphere_that_shines_inwards(setup, inside):
    """E = pi L at every point and for every normal: all that is seen is the lamp."""
    for normal in ([0, 0, 1], [1, 0, 0], [-1, 2, -3]):
        position = center("lamp") + inside
        assert abs(setup.irradiance_z("lamp", position, normal, np.pi)) < SIGMA


@pytest.mark.parametrize("height", [0.1, 1.0, 4.0])
def test_disk_light_on_its_axis(setup, height):
    """E = pi L R^2 / (R^2 + h^2) (row D)."""
    position = beside("disk", 0, 0, height)
    expected = np.pi / (1 + height**2)
    assert abs(setup.irradiance_z("disk", position, [0, 0, -1], expected)) < SIGMA


def parallel_rectangle(a, b):
    """Form factor of a rectangle seen from below its corner, sides a, b over the height."""
    p, q = np.sqrt(1 + a * a), np.sqrt(1 + b * b)
    return (a / p * np.arctan(b / p) + b / q * np.arctan(a / q)) / (2 * np.pi)


@pytest.mark.parametrize("name", ["rectangle", "mirrored"])
@pytest.mark.parametrize(
    ("where", "expected"),
    [
        ((0, 0, 1), 0.5541264),
        ((0, 0, 2), 4 * parallel_rectangle(0.5, 0.5)),
        ((1, 1, 1), parallel_rectangle(2, 2)),
        ((1, 1, 2), 0.1385316),
        ((0, 1, 4), 2 * parallel_rectangle(0.25, 0.5)),
    ],
)
def test_rectangle_light(setup, name, where, expected):
    """Parallel receiver below the middle, a corner and a side (row E)."""
    z = setup.irradiance_z(name, center(name) + where, [0, 0, -1], np.pi * expected)
    assert abs(z) < SIGMA


def polygon_irradiance(corners, position, normal):
    """E / L of a polygon above the horizon: half the sum of angle x normal (Lambert)."""
    v = unit(np.asarray(corners) - position)
    w = np.roll(v, -1, axis=0)
    theta = np.arccos(np.clip(np.sum(v * w, axis=1), -1, 1))
    return 0.5 * np.sum(theta * (unit(np.cross(v, w)) @ unit(normal)))


def cube_faces():
    """The corners of each face of the cube light, counter-clockwise from outside."""
    half = np.array([1, 0.5, 0.25])
    for axis in range(3):
        for sign in (1, -1):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            square = np.zeros((4, 3))
            square[:, axis] = sign
            square[:, u], square[:, v] = [-1, 1, 1, -1], [-1, -1, 1, 1]
            if sign < 0:
                square = square[::-1]
            outward = np.eye(3)[axis] * sign
            yield square * half + center("cube"), outward


@pytest.mark.parametrize("where", [(0, 0, 2), (2, 1, 1), (-3, 0.2, 0.1), (1.5, 2, -1)])
def test_mesh_light(setup, where):
    """A box: its faces by Lambert's formula (row F); those turned away give nothing."""
    position = center("cube") + where
    normal = -unit(where)
    expected = 0.0
    for corners, outward in cube_faces():
        if (position - corners[0]) @ outward > 0:
            expected += abs(polygon_irradiance(corners, position, normal))
    assert abs(setup.irradiance_z("cube", position, normal, expected)) < SIGMA


# ------------------------------------------------------------------------- from behind


BEHIND = [
    ("rectangle", (0.3, 0.2, -1)),
    ("mirrored", (0.3, 0.2, -1)),
    ("flipped", (0.3, 0.2, 1)),
    ("disk", (0.3, 0.2, -1)),
    ("ellipse", (0.3, 0.2, -1)),
    ("sphere", (0.3, 0.2, 0.1)),
    ("lamp", (3, 1, 1)),
    ("cube", (0.3, 0.2, 0.1)),
    ("cylinder", (0.1, 0.2, 1)),
]


@pytest.mark.parametrize(("name", "where"), BEHIND)
def test_a_light_seen_from_behind_gives_nothing(setup, name, where):
    """Behind flat ones, inside closed ones, outside of the lamp."""
    _, radiance, _, pdf = setup.sample(name, center(name) + where)
    np.testing.assert_array_equal(radiance, 0)
    assert not np.isnan(pdf).any(), f"{np.isnan(pdf).sum()} densities are NaN"


@pytest.mark.parametrize(
    ("name", "where"),
    [
        ("rectangle", (0.1, 0.2, 0)),
        ("disk", (0.1, 0, 0)),
        ("rectangle", (3, 0, 0)),
        ("sphere", (0, 0, 1)),
        ("lamp", (0, 0, 1)),
        ("cylinder", (0.5, 0, 1)),
        ("cube", (1, 0.1, 0.1)),
    ],
)
def test_points_of_the_light_itself_stay_finite(setup, name, where):
    """In its plane, on its surface: where r or a cosine can be 0."""
    wi, radiance, _, _ = setup.sample(name, center(name) + where)
    normal = np.ones(3) / np.sqrt(3)
    usable = (wi @ normal > 0) & (radiance.sum(axis=1) > 0)
    finite = np.isfinite(radiance[usable])
    assert finite.all(), f"{(~finite).sum()} of {finite.size} values are not finite"


# -------------------------------------------------------------------------- densities


SEEN_FROM = [
    ("rectangle", (0.5, -0.3, 1)),
    ("mirrored", (0.5, -0.3, 1)),
    ("flipped", (0.5, -0.3, -1)),
    ("disk", (1, 0, 0.7)),
    ("ellipse", (0.5, 0, 1)),
    ("sphere", (1, 1, 1)),
    ("lamp", (0.2, 0.5, -0.3)),
    ("cube", (1.5, 0.4, 1)),
    ("cylinder", (1, 0.5, 0.7)),
]


def front_cosine(setup, name, points, wi):
    """Cosine between -wi and the shining normal, from the shape's formula."""
    local = points - center(name)
    if name in ("sphere", "lamp"):
        normal = unit(local) * (1 if name == "sphere" else -1)
    elif name == "cylinder":
        normal = unit(local * [1, 1, 0])
    elif name == "cube":
        scaled = local / [1, 0.5, 0.25]
        axis = np.abs(scaled).argmax(axis=1)
        normal = np.eye(3)[axis] * np.sign(np.take_along_axis(scaled, axis[:, None], 1))
    else:
        normal = np.broadcast_to([0, 0, -1.0 if name == "flipped" else 1.0], local.shape)
    return -np.sum(wi * normal, axis=1)


@pytest.mark.parametrize(("name", "where"), SEEN_FROM)
def test_samples_are_where_they_say(setup, name, where):
    """A ray along wi meets the light at the distance; radiance times pdf is L there."""
    position = float32(center(name) + where)
    wi, radiance, distance, pdf = setup.sample(name, position)
    lit = radiance[:, 1] > 0
    np.testing.assert_allclose(np.linalg.norm(wi, axis=1), 1, rtol=5e-7)
    np.testing.assert_allclose(
        (radiance * pdf[:, None])[lit], np.tile(L, (lit.sum(), 1)), rtol=1e-6
    )
    found = nearest(setup.tracing, position, wi)
    own = (found.prim >= 0) & (setup.scene.shape[found.prim] == NAMES.index(name))
    assert np.mean(own[lit]) > 0.999  # silhouettes and borders
    same = own & lit
    # a ray that grazes a curved light is uncertain by the root of the rounding
    assert np.mean(np.abs(found.t - distance)[same] > 1e-3) < 2e-3
    # and both sides agree on the density of that direction
    points = position + wi * distance[:, None]
    cosine = front_cosine(setup, name, points, wi)
    steep = same & (cosine > 0.05)
    part = type(found)(*(a[steep] for a in found))._replace(t=distance[steep])
    again = setup.density_at(name, position, part, cosine[steep])
    np.testing.assert_allclose(again, pdf[steep], rtol=2e-3)


def test_a_far_sphere_has_the_density_of_its_solid_angle(setup):
    """Omega = pi (R / d)^2 for R / d = 1e-4, where 1 - cos alone would be 0 in float32."""
    _, _, _, pdf = setup.sample("sphere", beside("sphere", 0, 0, 1e4))
    np.testing.assert_allclose(pdf, 1e8 / np.pi, rtol=1e-5)


def test_lights_are_chosen_evenly(setup):
    """Also for the largest number below 1."""
    number = np.float32(np.random.default_rng(6).random(N))
    number[0], number[1] = 1 - 2.0**-24, 0
    light = setup.choices(number)
    assert light[0] == len(NAMES) - 1 and light[1] == 0
    assert chi_square_z(np.bincount(light, minlength=len(NAMES))) < SIGMA


@pytest.mark.parametrize("seed", range(5))
def test_alias_tables_have_the_weights_as_probabilities(seed):
    """Exactly, for weights of very different size, zeros among them [Walker1977]."""
    rng = np.random.default_rng(seed)
    weights = 10.0 ** rng.uniform(-8, 3, rng.integers(1, 200))
    weights[rng.random(len(weights)) < 0.1] = 0
    weights[0] = 1.0
    keep, alias = alias_table(weights)
    assert 0.0 <= keep.min() and keep.max() <= 1.0 + 1e-12, "probabilities to stay"
    chance = np.zeros(len(weights))
    np.add.at(chance, np.arange(len(weights)), keep)
    np.add.at(chance, alias, 1 - keep)
    np.testing.assert_allclose(chance / len(weights), weights / weights.sum(), atol=1e-13)
