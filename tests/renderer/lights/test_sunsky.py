"""Sun and sky: known values, dates, kernels against NumPy, sampling, and refusals.

tests/mitsuba_ref/paths/test_sunsky_and_mitsuba.py compares with Mitsuba; the scene
tests/plugins/sunsky.xml is replayed.
"""

from __future__ import annotations

import numpy as np
import pytest
from chi_square import assert_follows, cell_masses, histogram
from light_probes import LightProbe
from small_scenes import diffuse, floor, pixels, scene, sensor

import renderer
from renderer.errors import SceneError
from renderer.plugins.lights.sky_model import make_sky
from renderer.plugins.lights.sun_position import Moment, sun_at
from renderer.scene.light_tables import light_bounds
from renderer.scene_file import read_dict, read_string
from renderer.simple.sky import Sky

N = 1 << 18
SUN = np.array([0.4, -0.5, 0.6])
TURNED = np.eye(4)
TURNED[:3, :3] = [[0.36, 0.48, -0.8], [-0.8, 0.6, 0], [-0.48, -0.64, -0.6]]  # mirrored
SETS = {
    "defaults": {},
    "hazy": {"turbidity": 5.5, "albedo": 0.7, "sky_scale": 2.0, "sun_aperture": 3.0},
    "limb": {"turbidity": 2.2, "complex_sun": True, "sun_aperture": 8.0, "sun_scale": 0.1},
    "sky": {"sun_scale": 0.0, "turbidity": 9.7},
    "sun": {"sky_scale": 0.0, "sun_aperture": 20.0},
    "turned": {"to_world": TURNED, "sun_direction": [0.3, 0.8, -0.6]},
}


def sunsky(**settings):
    return {"type": "sunsky", "sun_direction": SUN.tolist(), **settings}


def described(**settings):
    content = {"type": "scene", "sensor": {"type": "perspective"}}
    (light,) = read_dict({**content, "sky": sunsky(**settings)}).emitters
    return light


def probe(**settings):
    return LightProbe(
        {"lamp": {"type": "rectangle"}}, {"sky": sunsky(**settings)}, (1.0, 1.0, 1.0)
    )


@pytest.fixture(scope="module")
def probes():
    return {name: probe(**settings) for name, settings in SETS.items()}


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def directions(sun, n=1000):
    """Of the whole sphere, and as many around the sun."""
    rng = np.random.default_rng(3)
    around = sun + 0.05 * rng.normal(size=(n, 3))
    return np.float32(unit(np.concatenate([rng.normal(size=(n, 3)), around]))).astype(float)


def test_a_known_sky(probes):
    """Values that Mitsuba 3.9.1 gives for the sun at (0.4, -0.5, 0.6)."""
    sky = make_sky(described())
    assert sky.share == pytest.approx(0.3854304, rel=2e-6)
    warp = 0.1739, 0.5303485, 0.411814, 0.4102815, 0.4632481
    np.testing.assert_allclose(sky.warp, warp, rtol=2e-6)
    wi = unit(np.array([[0, 0, 1], [0.6, 0, 0.8], SUN, [0, 1, 0], [0, 0.6, -0.8]]))
    radiance, pdf = probes["defaults"].environment("sky", wi)
    expected = np.zeros((5, 3))
    expected[0] = 0.02275617, 0.04018934, 0.0815011
    expected[1] = 0.04101431, 0.06467529, 0.11375297
    expected[2] = 21277.42, 17413.97, 12719.41
    expected[3] = 0.14837068, 0.17501234, 0.15851717
    np.testing.assert_allclose(radiance, expected, rtol=5e-6)
    assert pdf[4] == 0.0 < pdf[:4].min()


def test_the_sun_of_a_summer_day_in_tokyo():
    for hour, expected in (
        (6.0, (-0.2761, -0.9238, 0.26524)),
        (9.0, (0.0957, -0.61479, 0.78287)),
        (12.0, (0.23112, 0.05439, 0.9714)),
        (15.0, (0.05138545, 0.69174796, 0.72030848)),
        (18.0, (-0.33858, 0.92423, 0.17651)),
    ):
        np.testing.assert_allclose(sun_at(Moment(hour=hour)), expected, atol=1e-5)


def test_a_date_counts_in_the_local_frame():
    """`to_world` turns a sun that is given by time, not one that is given by direction."""
    turned = {"type": "sunsky", "hour": 9.0, "to_world": TURNED}
    content = {"type": "scene", "sensor": {"type": "perspective"}, "sky": turned}
    (light,) = read_dict(content).emitters
    expected = TURNED[:3, :3] @ sun_at(Moment(hour=9.0))
    np.testing.assert_allclose(light.sun_direction, expected, atol=1e-12)
    np.testing.assert_allclose(make_sky(light).sun, sun_at(Moment(hour=9.0)), atol=1e-12)
    plain = described(to_world=TURNED).sun_direction
    np.testing.assert_allclose(plain, unit(SUN), atol=1e-12)


@pytest.mark.parametrize("name", SETS)
def test_radiance_and_density_are_those_of_the_simple_renderer(name, probes):
    """In double precision; not within a rounding of the sun's edge."""
    light = described(**SETS[name])
    simple = Sky(light)
    wi = directions(np.array(light.sun_direction))
    cosine = np.array([simple.local(d) @ simple.sky.sun for d in wi])
    wi = wi[np.abs(cosine - simple.sky.cosine) > 1e-6]
    radiance, pdf = probes[name].environment("sky", wi)
    expected = np.array([simple.radiance(d) for d in wi])
    np.testing.assert_allclose(radiance, expected, rtol=5e-5, atol=1e-7)
    np.testing.assert_allclose(pdf, [simple.pdf(d) for d in wi], rtol=2e-5, atol=1e-7)
    assert (pdf > 0).any() and (pdf == 0).any()


@pytest.mark.parametrize("name", SETS)
def test_samples_are_those_of_the_simple_renderer(name, probes):
    simple = Sky(described(**SETS[name]))
    numbers = np.random.default_rng(5).random((3, 1000), np.float32)
    drawn = probes[name].sample("sky", [0.1, 0.2, 0.3], numbers)
    for k, (x, y, _) in enumerate(numbers.T.astype(float)):
        wi, in_sun = simple.sample(x, y)
        np.testing.assert_allclose(drawn.wi[k], wi, atol=2e-5)
        pdf = simple.pdf(wi, in_sun)
        if abs(simple.local(wi) @ simple.sky.sun - simple.sky.cosine) > 1e-6:
            assert drawn.pdf[k] == pytest.approx(pdf, rel=1e-4, abs=1e-7)
            weight = simple.radiance(wi, in_sun) / pdf if pdf > 0.0 else np.zeros(3)
            np.testing.assert_allclose(drawn.radiance[k], weight, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("settings", [{}, {"turbidity": 9.7, "sun_direction": [1, 2, 0.1]}])
def test_samples_of_the_sky_follow_the_density(settings):
    """Over the cosine to the zenith and the azimuth; false alarm rate 1e-5."""
    sky = probe(sun_scale=0.0, **settings)
    c, azimuth = np.linspace(0, 1, 17), np.linspace(-np.pi, np.pi, 17)

    def stated(c, azimuth):
        across = np.sqrt(1 - c * c)
        wi = np.stack([across * np.cos(azimuth), across * np.sin(azimuth), c], axis=1)
        return sky.environment("sky", wi)[1]

    numbers = np.random.default_rng(7).random((3, N), np.float32)
    x, y, z = sky.sample("sky", np.zeros(3), numbers).wi.T
    counts = histogram(z, np.arctan2(y, x), c, azimuth)
    masses = cell_masses(stated, c, azimuth)
    assert_follows(counts, masses, N, finds=0.07, within=1e-4)


def test_samples_of_the_sun_fill_it_evenly(probes):
    """By 1 less the cosine to its centre, and the angle around it."""
    light = make_sky(described(**SETS["sun"]))
    numbers = np.random.default_rng(7).random((3, N), np.float32)
    drawn = probes["sun"].sample("sky", np.zeros(3), numbers)
    height = 1.0 - light.cosine
    np.testing.assert_allclose(drawn.pdf, 1 / (2 * np.pi * height), rtol=1e-6)
    a = 0.5 * np.sum((drawn.wi - light.sun) ** 2, axis=1) / height
    s = unit(np.cross(light.sun, [0, 0, 1]))
    b = np.arctan2(drawn.wi @ np.cross(light.sun, s), drawn.wi @ s) / (2 * np.pi) % 1.0
    edges = np.linspace(0, 1, 17)
    counts = histogram(np.minimum(a, 1.0), b, edges, edges)
    assert_follows(counts, np.full((16, 16), 1 / 256), N, finds=0.07)


def test_a_sun_on_a_floor(probes):
    """E cos / pi of the reflectance: the light of the whole sun, whatever its angle."""
    for aperture in (0.5358, 5.0):
        light = sunsky(sky_scale=0.0, sun_aperture=aperture)
        sky = make_sky(described(sky_scale=0.0, sun_aperture=aperture))
        irradiance = sky.disk * 2 * np.pi * (1.0 - sky.cosine) * sky.sun[2]
        view = sensor((0, 0, 10), (0, 0, 0), up=(0, 1, 0), size=(8, 8), spp=64)
        found = pixels(scene(view, "path", floor(0.5), light)).mean(axis=(0, 1))
        np.testing.assert_allclose(found, 0.5 * irradiance / np.pi, rtol=2e-3)


@pytest.mark.parametrize("name", ["defaults", "hazy", "sky", "sun"])
def test_lights_are_chosen_by_the_mean_radiance(name):
    """The tables' powers against a mean over all directions, of the fitted formula."""
    sky = Sky(described(**SETS[name]))
    c, azimuth = (np.arange(24) + 0.5) / 24, (np.arange(48) + 0.5) * np.pi / 24
    grid = np.stack(np.meshgrid(c, azimuth), axis=-1).reshape(-1, 2)
    across = np.sqrt(1 - grid[:, 0] ** 2)
    wi = [across * np.cos(grid[:, 1]), across * np.sin(grid[:, 1]), grid[:, 0]]
    mean = 0.5 * np.mean([sky._of_sky(d) for d in np.transpose(wi)])
    mean += 0.5 * (1.0 - sky.sky.cosine) * sky.sky.disk.mean()
    assert sky.sky.mean == pytest.approx(mean, rel=0.12)


def test_a_sun_below_the_horizon_is_black_and_said():
    content = scene(
        sensor((0, 0, 10), (0, 0, 0), up=(0, 1, 0), size=(4, 4), spp=256),
        "path",
        {"type": "rectangle", "bsdf": diffuse(0.5)},
        sunsky(sun_direction=[0.4, -0.5, -0.01]),
        {"type": "point", "position": [0.0, 0.0, 5.0]},
    )
    loaded = renderer.load_dict(content)
    (warning,) = loaded.description.warnings
    assert 'emitter "sunsky": the sun is below the horizon' in warning
    assert light_bounds(loaded)[0].strength == 0.0
    lit = pixels(content).mean()
    del content["part1"]
    assert lit == pytest.approx(pixels(content).mean(), rel=0.02)
    dark = probe(sun_direction=[0.4, -0.5, -0.01])
    radiance, pdf = dark.environment("sky", directions(SUN))
    assert not radiance.any() and not pdf.any()
    drawn = dark.sample("sky", np.zeros(3), np.random.default_rng(1).random((3, 64), "f4"))
    assert not drawn.radiance.any() and not drawn.pdf.any()


def test_what_cannot_be_is_one_line():
    def number(name, value, kind="float"):
        return f'<{kind} name="{name}" value="{value}"/>'

    direction = '<vector name="sun_direction" x="0" y="0" z="{}"/>'
    for text, words in (
        (number("turbidity", 11), 'property "turbidity": found 11, expected at least'),
        (number("turbidity", 0.5), "found 0.5, expected at least 1 and at most 10"),
        (number("albedo", 1.2), 'property "albedo"'),
        (number("sky_scale", -1), "found -1, expected at least 0"),
        (number("sun_scale", 1e30), "at most 1e+20"),
        (number("sun_aperture", 180), "at most 179.99"),
        (
            number("sun_aperture", 0.01),
            "whose solid angle is 0 in single precision, expected at least 0.028",
        ),
        (number("hour", 25), "found 25, expected at least 0 and at most 24"),
        (number("month", 13, "integer"), "found 13, expected at least 1 and at most 12"),
        (number("day", 3.5), "a value of type float, expected integer"),
        (number("stretch", 1.0), 'has no property "stretch"; supported: '),
        (direction.format(0), "found the zero vector, expected a direction"),
        (
            direction.format(1) + number("hour", 3),
            'property "hour": found a value together with "sun_direction", expected one',
        ),
        ('<transform name="to_world"><scale x="2"/></transform>', "stretches directions"),
        ('<texture name="albedo" type="checkerboard"/>', "varies over the surface"),
        (number("sampling_weight", 2), "lights are chosen with equal probability"),
    ):
        emitter = f'<emitter type="sunsky">\n{text}</emitter><sensor type="perspective"/>'
        with pytest.raises(SceneError) as caught:
            read_string(f'<scene version="3.0.0">\n{emitter}</scene>')
        message = str(caught.value)
        assert message.startswith(("<string>:2: ", "<string>:3: ")) and "\n" not in message
        assert words in message
