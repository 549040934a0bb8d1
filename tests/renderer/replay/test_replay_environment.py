"""Environment maps in a replay: Mitsuba's directions to the bit, and no defect hidden."""

import numpy as np
import pytest
from environment_maps import LAMP, directions, turned, write_map
from light_probes import LightProbe

import renderer.replay.replay_mode
from renderer.plugins.lights.envmap import EnvironmentMaps
from renderer.replay.environment import rounded_environment

mi = pytest.importorskip("mitsuba")
N = 1500
WHITE = (1.0, 1.0, 1.0)


def steep(height=64, width=128):
    """Texels of which one is often ten times its neighbour: all digits of a place count."""
    rng = np.random.default_rng(3)
    return np.exp(2.0 * rng.normal(size=(height, width, 3))).astype(np.float32)


MAPS = {
    "as it is": {},
    "turned": {"to_world": np.array(turned().matrix, np.float64)},
    "compensated": {"mis_compensation": True},
}


@pytest.fixture(scope="module", params=list(MAPS))
def pair(request, tmp_path_factory):
    """Ours and Mitsuba's environment."""
    path = write_map(tmp_path_factory.mktemp("sky") / "steep.exr", steep())
    settings = MAPS[request.param]
    matrix = " ".join(map(repr, settings.get("to_world", np.eye(4)).ravel().tolist()))
    compensated = str(settings.get("mis_compensation", False)).lower()
    theirs = mi.load_string(  # a file's matrix is inverted in double precision
        f"""<scene version="3.0.0"><shape type="sphere"/><emitter type="envmap">
        <string name="filename" value="{path}"/>
        <boolean name="mis_compensation" value="{compensated}"/>
        <transform name="to_world"><matrix value="{matrix}"/></transform>
        </emitter></scene>"""
    ).environment()
    content = {"type": "envmap", "filename": path, **settings}
    return LightProbe(LAMP, {"sky": content}, WHITE, replay=True), theirs


def numbers():
    return np.random.default_rng(5).random((3, N), np.float32)


def asked(theirs, random):
    """Mitsuba's directions, densities and weights."""
    at = mi.Interaction3f()
    at.p = [0.1, 0.2, 0.3]
    found = [theirs.sample_direction(at, mi.Point2f(x, y)) for x, y, _ in random.T]
    wi, pdf = [np.array(ds.d) for ds, _ in found], [ds.pdf for ds, _ in found]
    return np.array(wi), np.array(pdf), np.array([np.array(weight) for _, weight in found])


def test_samples_are_mitsubas(pair):
    """All bits of most directions, and the last one of others; light to a few roundings."""
    ours, theirs = pair
    drawn = ours.sample("sky", [0.1, 0.2, 0.3], numbers())
    wi, pdf, weight = asked(theirs, numbers())
    assert (drawn.wi == wi).all(axis=1).mean() > 0.97
    for found, expected, most in ((drawn.pdf, pdf, 2e-6), (drawn.radiance, weight, 2e-5)):
        off = np.abs(found / expected - 1.0)
        assert np.quantile(off, 0.97) < most
        assert off.max() < 2e-3
    np.testing.assert_allclose(drawn.wi, wi, atol=2e-6)


def test_lookups_are_mitsubas(pair):
    """The same place in the image. At a pole acos makes much of a last bit: 1 in 200."""
    ours, theirs = pair
    wi = directions(N)
    radiance, pdf = ours.environment("sky", wi)
    at, sample = mi.SurfaceInteraction3f(), mi.DirectionSample3f()
    expected, density = [], []
    for d in wi:
        at.wi, sample.d = mi.Vector3f(-d), mi.Vector3f(d)
        expected.append(np.array(theirs.eval(at)))
        density.append(theirs.pdf_direction(at, sample))
    off = np.abs(radiance - expected).max(axis=1) / np.max(expected, axis=1)
    assert np.quantile(off, 0.99) < 2e-6
    off = np.abs(pdf - density) / np.maximum(density, 1e-3 * np.max(density))
    assert np.quantile(off, 0.99) < 5e-6


def probes(tmp_path, monkeypatch, broken):
    """The environment as it is, and with our own table as `broken` returns it."""
    path = write_map(tmp_path / "steep.exr", steep())
    content = {"type": "envmap", "filename": path}
    right = LightProbe(LAMP, {"sky": content}, WHITE, replay=True)

    def of_broken(own: EnvironmentMaps, sky):
        return rounded_environment(own, sky)._replace(own=broken(own))

    monkeypatch.setattr(renderer.replay.replay_mode, "rounded_environment", of_broken)
    return LightProbe(LAMP, {"sky": content}, WHITE, replay=True), right


def test_a_density_of_ours_stays(tmp_path, monkeypatch):
    """Mitsuba's table is right, ours 0.1 % off; a replay shows ours, both ways."""

    def denser(own):
        nodes = own.warp.nodes * np.float32(1.001)
        return own._replace(warp=own.warp._replace(nodes=nodes))

    wrong, right = probes(tmp_path, monkeypatch, denser)
    wi = directions(N)
    off = wrong.environment("sky", wi)[1] / right.environment("sky", wi)[1]
    np.testing.assert_allclose(off, 1.001, rtol=1e-5)
    a, b = (probe.sample("sky", np.zeros(3), numbers()) for probe in (wrong, right))
    np.testing.assert_array_equal(a.wi, b.wi)
    # next to a texel that is 100 times as bright, 0.1 % may be a rounding of the place
    clear = np.abs(a.pdf / b.pdf - 1.001) < 1e-4
    assert clear.mean() > 0.99


@pytest.mark.parametrize(("share", "stays"), [(1.02, True), (1.0 + 1e-6, False)])
def test_a_choice_of_ours_stays(tmp_path, monkeypatch, share, stays):
    """Parts of our warp are too large: directions turn by more than 1e-4, or by less."""

    def drawn_elsewhere(own):
        blocks = own.warp.blocks.copy()
        blocks[0] *= np.float32(share)
        return own._replace(warp=own.warp._replace(blocks=blocks))

    wrong, right = probes(tmp_path, monkeypatch, drawn_elsewhere)
    a, b = (probe.sample("sky", np.zeros(3), numbers()) for probe in (wrong, right))
    other = (a.wi != b.wi).any(axis=1).mean()
    assert other > 0.95 if stays else other < 0.02


def with_bright_poles(height, width):
    """Texels near the poles that outshine all others: there the sine's last bits count."""
    rng = np.random.default_rng(7)
    texels = rng.uniform(0.1, 0.9, (height, width, 3))
    texels[[0, -1]] *= rng.uniform(2.0, 15.0, (2, width, 3))
    texels[:, [0, -1]] *= 6.0
    return texels.astype(np.float32)


@pytest.mark.parametrize("compensated", [False, True], ids=["as it is", "compensated"])
@pytest.mark.parametrize("size", [(8, 16), (9, 17), (8, 6), (32, 64)])
def test_samples_of_maps_with_bright_poles_are_mitsubas(size, compensated, tmp_path):
    """The sine of its last row is negative in Mitsuba, -8.7e-8, and moves samples by 0.4.

    In a compensated map that is nearly black but there it moves the shares of patches by
    1e-4 of all, and next to where a density begins at 0 goes with the root of that.
    """
    path = write_map(tmp_path / "poles.exr", with_bright_poles(*size))
    content = {"type": "envmap", "filename": path, "mis_compensation": compensated}
    theirs = mi.load_dict({"type": "scene", "ball": {"type": "sphere"}, "sky": content})
    ours = LightProbe(LAMP, {"sky": content}, WHITE, replay=True)
    drawn = ours.sample("sky", [0.1, 0.2, 0.3], numbers())
    wi, pdf, _ = asked(theirs.environment(), numbers())
    assert (drawn.wi == wi).all(axis=1).mean() > 0.998
    chosen = pdf > 0.0
    off = np.abs(drawn.pdf[chosen] / pdf[chosen] - 1.0)
    assert np.quantile(off, 0.998) < 1e-6
