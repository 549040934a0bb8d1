"""Environment maps: look-up, sampling and density, against Mitsuba's and by themselves.

Maps with what goes wrong: steep noise, a single bright texel, one on the seam of the
circle, light at the poles, an even one, one of a single pixel, one turned and mirrored.
"""

from __future__ import annotations

import numpy as np
import pytest
from chi_square import assert_follows, cell_masses, histogram
from environment_maps import LAMP, directions, turned, write_map
from light_probes import LightProbe
from scene_file_samples import error_of
from small_scenes import diffuse, pixels, placed, scene, sensor, sphere

import renderer
from renderer.errors import NotReplayable

mi = pytest.importorskip("mitsuba")

N = 1 << 18
SEED = 20


def noise(height, width):
    rng = np.random.default_rng(5)
    return rng.random((height, width, 3), np.float32) ** 4 * 5


def dark_but(height, width, *bright):
    image = np.full((height, width, 3), 0.01, np.float32)
    for row, column in bright:
        image[row, column] = 100.0, 80.0, 50.0
    return image


MAPS = {
    "noise": (noise(9, 16), {"scale": 1.7}),
    "turned": (noise(13, 7), {"scale": 0.3, "turned": True}),
    "compensated": (noise(8, 16), {"mis_compensation": True}),
    "one texel": (dark_but(17, 32, (5, 20)), {}),
    "seam": (dark_but(8, 12, (3, 0), (4, 11)), {}),
    "poles": (dark_but(9, 8, (0, slice(None)), (8, slice(None)), (1, 3)), {}),
    "even": (np.ones((4, 8, 3), np.float32), {"mis_compensation": True}),
    "negative": (noise(7, 9) - 0.3, {}),
    "negative, compensated": (noise(8, 9) - 0.3, {"mis_compensation": True}),
    "one pixel": (np.full((1, 1, 3), 2.0, np.float32), {}),
}


class Pair:
    """One environment in both renderers."""

    def __init__(self, name, folder):
        self.image, settings = MAPS[name]
        settings = dict(settings)
        self.to_world = turned() if settings.pop("turned", False) else None
        self.content = {
            "type": "envmap",
            "filename": write_map(folder / f"{name}.exr", self.image),
            **settings,
        }
        if self.to_world is not None:
            self.content["to_world"] = self.to_world
        ours = self.content
        if self.to_world is not None:
            ours = {**ours, "to_world": np.array(self.to_world.matrix, np.float64)}
        self.ours = LightProbe(LAMP, {"sky": ours}, (1.0, 1.0, 1.0))
        world = {"type": "scene", "ball": {"type": "sphere"}, "sky": self.content}
        self.scene = mi.load_dict(world)
        self.theirs = self.scene.environment()


@pytest.fixture(scope="module", params=list(MAPS))
def pair(request, tmp_path_factory):
    return Pair(request.param, tmp_path_factory.mktemp("maps"))


def assert_close(mine, reference, within):
    """Relative, and by a thousandth of it to the largest value: 99 % and all values.

    Both renderers go by way of angles. Close to a pole acos has an error of the root of
    the rounding error, and the density is divided by the sine; and what is left of a
    random number after a choice of 1 in 10^4 has as many digits less.
    """
    scale = np.maximum(np.abs(reference), 1e-3 * np.abs(reference).max())
    off = np.abs(mine - reference) / scale
    assert np.quantile(off, 0.99) < within, f"{np.quantile(off, 0.99):.1e}"
    assert off.max() < 0.2, f"{off.max():.1e}"


def test_radiance_and_density_by_direction(pair):
    """Steep maps lose digits in the angles; an even one is exact to rounding."""
    wi = directions(1500)
    radiance, pdf = pair.ours.environment("sky", wi)
    their_radiance, their_pdf = [], []
    at = mi.SurfaceInteraction3f()
    sample = mi.DirectionSample3f()
    for d in wi:
        at.wi = mi.Vector3f(-d)
        sample.d = mi.Vector3f(d)
        their_radiance.append(np.array(pair.theirs.eval(at)).ravel())
        their_pdf.append(pair.theirs.pdf_direction(at, sample))
    assert_close(radiance, np.array(their_radiance), 1e-3)
    assert_close(pdf, np.array(their_pdf), 1e-3)


def test_rotations_of_few_digits_are_undone_by_their_inverse(tmp_path):
    """Their transpose, 1e-4 off, gave other texels: light was off by 9e-4 here."""
    path = write_map(tmp_path / "steep.exr", noise(64, 128))
    few_digits = np.array(turned().matrix, np.float64)
    few_digits[:3, :3] += 4e-5 * np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]])
    placed, plain = (
        LightProbe(LAMP, {"sky": sky}, (1.0, 1.0, 1.0))
        for sky in (
            {"type": "envmap", "filename": path, "to_world": few_digits},
            {"type": "envmap", "filename": path},
        )
    )
    d = directions(1500)
    radiance, pdf = placed.environment("sky", d @ few_digits[:3, :3].T)
    expected, density = plain.environment("sky", d)
    assert np.median(np.abs(radiance / expected - 1.0)) < 2e-5
    assert np.median(np.abs(pdf / density - 1.0)) < 2e-5


def test_samples(pair):
    """The same numbers give the same direction, density and weight."""
    numbers = np.random.default_rng(SEED).random((3, 1500), np.float32)
    drawn = pair.ours.sample("sky", [0.1, 0.2, 0.3], numbers)
    at = mi.Interaction3f()
    at.p = [0.1, 0.2, 0.3]
    d, pdf, weight = [], [], []
    for x, y, _ in numbers.T:
        sample, w = pair.theirs.sample_direction(at, mi.Point2f(x, y))
        d.append(np.array(sample.d).ravel())
        pdf.append(sample.pdf)
        weight.append(np.array(w).ravel())
    np.testing.assert_allclose(drawn.wi, d, atol=4e-4)
    assert_close(drawn.pdf, np.array(pdf), 3e-4)
    assert_close(drawn.radiance, np.array(weight), 1e-3)


def test_samples_follow_the_density(pair):
    """Chi-square over the patches of the map; 2^18 samples, false alarm rate 1e-5."""
    height, width = max(pair.image.shape[0], 3), max(pair.image.shape[1], 2)
    rotation = np.eye(3)
    if pair.to_world is not None:
        rotation = np.array(pair.to_world.matrix)[:3, :3]
    u, v = np.linspace(0, 1, width + 1), np.linspace(0, 1, height)

    def stated(u, v):
        phi, theta = 2 * np.pi * (u + 0.5 / width), np.pi * v
        sine = np.sin(theta)
        local = np.stack((np.sin(phi) * sine, np.cos(theta), -np.cos(phi) * sine))
        pdf = pair.ours.environment("sky", (rotation @ local).T)[1]
        return pdf * 2 * np.pi**2 * sine

    masses = cell_masses(lambda u, v: stated(u, v), u, v)
    numbers = np.random.default_rng(SEED).random((3, N), np.float32)
    x, y, z = (pair.ours.sample("sky", np.zeros(3), numbers).wi @ rotation).T
    turn = np.arctan2(x, -z) / (2 * np.pi) - 0.5 / width
    down = np.arctan2(np.hypot(x, z), y) / np.pi
    counts = histogram(turn - np.floor(turn), down, u, v)
    assert_follows(counts, masses, N, finds=0.07, within=1e-4)


# ------------------------------------------------------------------------ energy


def test_furnace(tmp_path):
    """Under an even map of radiance 1.5 a body of albedo 0.6 has the radiance 0.9."""
    even = np.full((4, 8, 3), 0.5, np.float32)
    sky = {"type": "envmap", "filename": write_map(tmp_path / "even.exr", even), "scale": 3}
    view = sensor((0, -5, 0), (0, 0, 0), size=(16, 16), fov=5.0, spp=256, jitter=True)
    picture = pixels(scene(view, "path", sphere(diffuse(0.6)), sky, max_depth=3))
    np.testing.assert_allclose(picture.mean(), 0.9, rtol=3e-3)


@pytest.mark.parametrize("compensated", [False, True])
@pytest.mark.parametrize("bright", [0.0, 1.0])
def test_what_luminance_cannot_choose_is_chosen_evenly(tmp_path, bright, compensated):
    """A black sky, and one that shines in its first row alone: a cap of 22.5 degrees.

    Its radiance falls linearly to the next row. Found by light samples alone, whose mean
    has a standard deviation of 2 %: 10 % are a false alarm of less than 1e-5.
    """
    rows, albedo = 9, 0.6
    image = np.zeros((rows, 8, 3), np.float32)
    image[0] = bright
    angle = (np.arange(2000) + 0.5) / 2000 * np.pi / (rows - 1)
    light = bright * (1.0 - angle * (rows - 1) / np.pi) * np.cos(angle) * np.sin(angle)
    expected = albedo * 2.0 * light.mean() * np.pi / (rows - 1)
    sky = {
        "type": "envmap",
        "filename": write_map(tmp_path / "sky.exr", image),
        "mis_compensation": compensated,
    }
    floor = {
        "type": "rectangle",
        "to_world": placed((0, 0, 0), (0, 0, 1), (1, 0, 0)),
        "bsdf": diffuse(albedo),
    }
    view = sensor((0, 5, 0), (0, 0, 0), size=(16, 16), fov=5.0, spp=256, jitter=True)
    picture = pixels(scene(view, "direct", floor, sky, bsdf_samples=0))
    np.testing.assert_allclose(picture.mean(), expected, rtol=0.1)


@pytest.mark.parametrize(("rest", "last_row"), [(0.0, 0.0), (0.0, 1.0), (1e-3, 5e5)])
def test_it_is_not_replayed(tmp_path, rest, last_row):
    """Mitsuba divides by the sum of all densities, which is 0, or negative by rounding."""
    image = np.full((4, 8, 3), rest, np.float32)
    image[-1] = last_row
    dark = write_map(tmp_path / "sky.exr", image)
    sky = {"type": "envmap", "filename": dark}
    view = sensor((0, -5, 0), (0, 0, 0), size=(4, 4), fov=5.0)
    dim = renderer.load_dict(scene(view, "path", sphere(diffuse(0.6)), sky))
    with pytest.raises(NotReplayable, match="is black, or shines in its first"):
        renderer.render(dim, sampler="mitsuba")


# --------------------------------------------------------------------- bad input


def env(properties, name="sky.exr"):
    filename = f'<string name="filename" value="{name}"/>'
    return f'<emitter type="envmap">{filename}{properties}</emitter>'


def with_value(value):
    image = np.ones((4, 4, 3), np.float32)
    image[1, 2, 1] = value
    return image


@pytest.mark.parametrize(
    ("image", "words"),
    [
        (with_value(np.nan), "the image has NaN or infinite pixels"),
        (with_value(np.inf), "the image has NaN or infinite pixels"),
    ],
    ids=["nan", "infinite"],
)
def test_pixels_that_cannot_be_sampled(image, words, tmp_path):
    write_map(tmp_path / "sky.exr", image)
    assert words in error_of(env(""), folder=tmp_path)


def test_files_and_properties_that_cannot_be_used(tmp_path):
    write_map(tmp_path / "sky.exr", noise(4, 8))
    (tmp_path / "cut.exr").write_bytes((tmp_path / "sky.exr").read_bytes()[:200])

    def refused(content):
        return error_of(content, folder=tmp_path)

    assert "damaged EXR file" in refused(env("", "cut.exr"))
    assert '"none.exr" not found; looked in' in refused(env("", "none.exr"))
    assert 'property "filename": found nothing' in refused('<emitter type="envmap"/>')
    scale = '<float name="scale" value="{}"/>'
    assert "at least 0" in refused(env(scale.format(-1)))
    assert "leaves all pixels at most 1e30" in refused(env(scale.format(3e38)))
    stretched = '<transform name="to_world"><scale x="2"/></transform>'
    assert "a transform that stretches directions" in refused(env(stretched))
    assert 'has no property "radiance"' in refused(
        env('<float name="radiance" value="1"/>')
    )
    two = env("") + '\n<emitter type="constant"/>'
    assert ':3: emitter "constant" is a second environment, after line 2' in refused(two)
