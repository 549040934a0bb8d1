"""Sun and sky against Mitsuba's own emitter: radiance, density, samples, dates, tables."""

from __future__ import annotations

import runpy
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from light_probes import LightProbe

from renderer.plugins.lights import sky_model, sun_position

mi.set_variant("scalar_rgb")
mi.set_log_level(mi.LogLevel.Error)  # of suns below the horizon

ROOT = Path(__file__).parents[3]
SUN = np.array([0.4, -0.5, 0.6]) / np.linalg.norm([0.4, -0.5, 0.6])
N = 1500
TURNED = mi.ScalarTransform4f().rotate([0.48, 0.64, 0.6], 40).rotate([1, 0, 0], -90)
SETS = {
    "defaults": {},
    "hazy": {
        **{"turbidity": 5.5, "albedo": 0.7, "sun_scale": 0.5},
        **{"sky_scale": 2.0, "sun_aperture": 3.0},
    },
    "limb": {"turbidity": 2.2, "complex_sun": True, "sun_aperture": 2.0},
    "sky": {"sun_scale": 0.0},
    "sun": {"sky_scale": 0.0},
    "turned": {"to_world": TURNED, "sun_aperture": 6.0},
}


@pytest.fixture(scope="module", params=list(SETS))
def pair(request):
    """The same emitter in both renderers, and the direction to its sun."""
    settings = SETS[request.param]
    to_world = settings.get("to_world", mi.ScalarTransform4f())
    matrix = np.array(to_world.matrix, np.float64)
    content = {"type": "sunsky", "sun_direction": (matrix[:3, :3] @ SUN).tolist()}
    theirs = mi.load_dict({**content, **settings})
    ours = {**content, **settings}
    if "to_world" in settings:
        ours["to_world"] = matrix
    lamp = {"lamp": {"type": "rectangle"}}
    return LightProbe(lamp, {"sky": ours}, (1.0, 1.0, 1.0)), theirs, matrix[:3, :3] @ SUN


def off_by(found, expected):
    """Largest relative difference, of what is above a thousandth of the median."""
    expected = np.asarray(expected, float)
    floor = 1e-3 * np.median(np.abs(expected[expected != 0.0]))
    return np.max(np.abs(found - expected) / np.maximum(np.abs(expected), floor))


def by_edge(wi, sun, settings):
    """Whether a direction is within a rounding of the sun's edge."""
    edge = np.cos(np.radians(0.5 * settings.get("sun_aperture", 0.5358)))
    return np.abs(wi @ sun - edge) < 5e-7


def test_radiance_and_density(pair, request):
    """A fifth of the sun's directions may be at its edge: it is 180 roundings wide."""
    ours, theirs, sun = pair
    rng = np.random.default_rng(2)
    wi = rng.normal(size=(N, 3))
    wi[::3] = sun + 0.01 * wi[::3]
    wi = np.float32(wi / np.linalg.norm(wi, axis=1)[:, None]).astype(float)
    settings = SETS[request.node.callspec.params["pair"]]
    wi = wi[~by_edge(wi, sun, settings)]
    at, sample = dr.zeros(mi.SurfaceInteraction3f), mi.DirectionSample3f()
    expected, density = [], []
    for d in wi:
        at.wi, sample.d = mi.Vector3f(-d), mi.Vector3f(d)
        expected.append(np.array(theirs.eval(at)))
        density.append(theirs.pdf_direction(at, sample))
    radiance, pdf = ours.environment("sky", wi)
    limit = 2e-3 if settings.get("complex_sun") else 2e-5
    assert off_by(radiance, expected) < limit
    assert off_by(pdf, density) < 2e-5


def test_samples(pair, request):
    """The same numbers give the same directions and weights."""
    ours, theirs, sun = pair
    numbers = np.random.default_rng(5).random((3, N), np.float32)
    drawn = ours.sample("sky", [0.1, 0.2, 0.3], numbers)
    at = dr.zeros(mi.SurfaceInteraction3f)
    at.p = [0.1, 0.2, 0.3]
    found = [theirs.sample_direction(at, mi.Point2f(x, y)) for x, y, _ in numbers.T]
    wi, pdf = np.array([ds.d for ds, _ in found]), np.array([ds.pdf for ds, _ in found])
    weight = np.array([np.array(weight) for _, weight in found])
    np.testing.assert_allclose(drawn.wi, wi.reshape(-1, 3), atol=2e-5)
    settings = SETS[request.node.callspec.params["pair"]]
    share = sky_model.make_sky(ours.scene.description.emitters[0]).share
    inside = (numbers[0] >= share) | ~by_edge(drawn.wi, sun, settings)
    assert off_by(drawn.pdf[inside], pdf[inside]) < 5e-5
    limit = 2e-3 if settings.get("complex_sun") else 5e-5
    assert off_by(drawn.radiance[inside], weight[inside]) < limit


def test_the_solid_angle_of_the_sun_is_mitsubas():
    """It is 1 less a cosine in single precision: one rounding is 1e-4 of it."""
    sun = {"type": "sunsky", "sun_direction": [0, 0.6, 0.8], "sky_scale": 0.0}
    for aperture in map(float, (*np.linspace(0.3, 15, 200), *np.linspace(16, 90, 40))):
        theirs = mi.load_dict({**sun, "sun_aperture": aperture})
        sample, _ = theirs.sample_direction(dr.zeros(mi.SurfaceInteraction3f), [0.4, 0.4])
        cosine = sky_model.half_cosine(aperture)
        assert 2 * np.pi * (1 - cosine) * sample.pdf == pytest.approx(1, rel=1e-6), aperture


def test_dates():
    """Where Mitsuba puts the sun, at 200 places and times."""
    rng = np.random.default_rng(4)
    apart = []
    for _ in range(200):
        when = sun_position.Moment(
            latitude=float(np.float32(rng.uniform(-80, 80))),
            longitude=float(np.float32(rng.uniform(-180, 180))),
            timezone=float(rng.integers(-11, 12)),
            year=int(rng.integers(1990, 2030)),
            month=int(rng.integers(1, 13)),
            day=int(rng.integers(1, 29)),
            hour=float(rng.integers(0, 24)),
            minute=float(rng.integers(0, 60)),
            second=float(rng.integers(0, 60)),
        )
        theirs = mi.load_dict({"type": "sunsky", **when._asdict()})
        expected = np.array(mi.traverse(theirs)["sun_direction"]).ravel()
        apart.append(np.abs(sun_position.sun_at(when) - expected).max())
    assert np.median(apart) < 5e-6 and max(apart) < 5e-5, (np.median(apart), max(apart))


def test_the_tables_are_those_of_mitsubas_wheel():
    made = runpy.run_path(str(ROOT / "docs" / "make_sunsky_tables.py"))["make_tables"]()
    kept = sky_model.tables()
    assert made.keys() == kept.keys()
    for name, table in made.items():
        np.testing.assert_array_equal(kept[name], table.astype(np.float64))
