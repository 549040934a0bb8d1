"""The measured BSDF `merl`: its file, its angles, its sampling, and its twin in Mitsuba."""

from __future__ import annotations

import numpy as np
import pytest
from bsdf_probes import BsdfProbe, MitsubaProbe, random_directions, seen_under
from chi_square import assert_follows, cell_masses, histogram
from scene_file_samples import mi
from small_scenes import scene, sensor

import renderer
from mitsuba_ref.reference.plugins.merl import register_merl
from renderer.errors import SceneError
from renderer.plugins.bsdfs.merl_file import (
    SCALES,
    cell_centres,
    edges_of_half_vectors,
    read_merl,
    write_merl,
)

register_merl(mi)
CELLS = (90, 90, 180)  # as in the database


def known(theta_h, theta_d, phi_d):
    """A lobe and a base that depend on all angles, with a period of pi in phi_d [1/sr]."""
    lobe = 3 * np.exp(-((theta_h / 0.15) ** 2)) * (1 + 0.4 * np.cos(2 * phi_d - 0.7))
    return np.stack(
        np.broadcast_arrays(
            0.1 + lobe, 0.2 + 0.1 * theta_d + 0 * phi_d, 0.05 + lobe * np.sin(theta_d)
        )
    )


def angles(wo, wi):
    """Rusinkiewicz' angles (1998) of pairs (n, 3) in float64, by turning vectors."""
    h = wo.astype(float) + wi
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    along = np.stack((h[:, 0] * h[:, 2], h[:, 1] * h[:, 2], h[:, 2] ** 2 - 1), axis=1)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(h, along)
    x, y = np.sum(wi * along, axis=1), np.sum(wi * across, axis=1)
    cos_d = np.minimum(np.sum(wi * h, axis=1), 1.0)
    return np.arccos(np.minimum(h[:, 2], 1.0)), np.arccos(cos_d), np.arctan2(y, x)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("merl") / "known.binary"
    write_merl(path, known(*cell_centres(CELLS)))
    return path


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    path = tmp_path_factory.mktemp("merl") / "small.binary"
    write_merl(path, known(*cell_centres((12, 7, 10))))
    return path


def merl(path):
    return {"type": "merl", "filename": str(path)}


def pairs(n, seed=3):
    """Directions above the surface: half at random, half near the mirrored ones."""
    rng = np.random.default_rng(seed)
    wo = random_directions(n, rng, both_sides=False)
    wi = random_directions(n, rng, both_sides=False)
    near = wo[::2] * (-1, -1, 1) + 0.1 * rng.standard_normal((len(wo[::2]), 3))
    wi[::2] = near / np.linalg.norm(near, axis=1, keepdims=True)
    return wo, wi


# ------------------------------------------------------------------------ the file


def test_a_file_is_read_as_it_was_written(small):
    """To the last bit of float32; the three colours have scales of their own."""
    expected = known(*cell_centres((12, 7, 10)))
    np.testing.assert_allclose(read_merl(small).f, expected, rtol=1e-6)
    stored = np.fromfile(small, "<f8", offset=12)
    assert stored[0] * SCALES[0] == pytest.approx(expected[0, 0, 0, 0])
    np.testing.assert_allclose(1500 * SCALES, (1, 1.15, 1.66))


def test_what_could_not_be_measured_is_black(tmp_path):
    f = np.full((3, 4, 4, 4), 0.5)
    f[:, 3, 3] = -1.0
    write_merl(tmp_path / "a.binary", f)
    read = read_merl(tmp_path / "a.binary").f
    assert (read[:, 3, 3] == 0).all() and (read[:, :3] == np.float32(0.5)).all()


def spoilt(name, path):
    good = path.read_bytes()
    return {
        "cut": good[:-1],
        "longer": good + b"\0",
        "header-alone": good[:12],
        "part-of-a-header": good[:7],
        "empty": b"",
        "text": b"<scene version='3.0.0'/>",
        "none-of-a-kind": np.array([12, 0, 10], "<i4").tobytes() + good[12:],
        "negative": np.array([12, -7, 10], "<i4").tobytes() + good[12:],
        "too-many": np.array([4096, 4096, 4096], "<i4").tobytes() + good[12:],
        "infinite": good[:-8] + np.array([np.inf]).tobytes(),
        "not-a-number": good[:12] + np.array([np.nan]).tobytes() + good[20:],
        "signalling": good[:12] + bytes.fromhex("010000000000f07f") + good[20:],
    }[name]


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("cut", r"bytes; three colours of 12 x 7 x 10 cells are 20172"),
        ("longer", "20173 bytes"),
        ("header-alone", "12 bytes"),
        ("part-of-a-header", "no MERL file"),
        ("empty", "no MERL file"),
        ("text", "no MERL file"),
        ("none-of-a-kind", "no MERL file"),
        ("negative", "no MERL file"),
        ("too-many", "at most"),
        ("infinite", "infinite or not a number"),
        ("not-a-number", "infinite or not a number"),
        ("signalling", "infinite or not a number"),
    ],
)
def test_a_wrong_file_is_an_error_that_says_where(name, says, small, tmp_path):
    (tmp_path / "wrong.binary").write_bytes(spoilt(name, small))
    text = (
        '<scene version="3.0.0"><sensor type="perspective"/>\n<shape type="sphere">\n'
        '<bsdf type="merl"><string name="filename" value="wrong.binary"/></bsdf>\n'
        "</shape></scene>"
    )
    scene = tmp_path / "scene.xml"
    scene.write_text(text)
    with pytest.raises(SceneError, match=says) as caught:
        renderer.load_file(scene)
    assert "scene.xml:3" in str(caught.value) and "wrong.binary" in str(caught.value)


def test_a_missing_file_or_none_is_an_error():
    for bsdf in ({"type": "merl"}, merl("nowhere.binary")):
        content = {"type": "scene", "shape": {"type": "sphere", "bsdf": bsdf}}
        with pytest.raises(SceneError, match=r"filename|nowhere"):
            renderer.load_dict({**content, "sensor": {"type": "perspective"}})


# --------------------------------------------------------------------- looking it up


def test_a_known_brdf_comes_back(file):
    """Between the centres of 90 x 90 x 180 cells linear interpolation is off by 4e-3."""
    wo, wi = pairs(1 << 13)
    found, _ = BsdfProbe(merl(file)).eval_pdf(wo, wi)
    above = wi[:, 2] > 0
    expected = (known(*angles(wo, wi)) * wi[:, 2]).T
    error = np.abs(found - expected)[above] / expected[above].max(axis=1, keepdims=True)
    assert np.quantile(error, 0.99) < 4e-3
    # flat to the left of the first centre and to the right of the last
    assert error.max() < 2e-2
    assert not found[~above].any()


def test_its_twin_in_mitsuba_says_the_same(small):
    """In double precision, written apart: values, densities, directions, weights.

    A table of few cells next to another BSDF, on both sides.
    """
    ours, theirs = BsdfProbe(merl(small), ({"type": "diffuse"},)), MitsubaProbe(merl(small))
    wo, wi = pairs(2000)
    wo[1::4, 2] *= -1
    above = wo[:, 2] > 0  # ours is evaluated from above alone
    for a, b in zip(ours.eval_pdf(wo, wi), theirs.eval_pdf(wo, wi), strict=True):
        np.testing.assert_allclose(a, b, rtol=2e-4, atol=2e-6)
    numbers = np.random.default_rng(5).random((2000, 3))
    a, b = ours.sample(wo, numbers), theirs.sample(wo, numbers)
    for one, other in ((a.wi, b.wi), (a.weight, b.weight), (a.pdf, b.pdf)):
        close = np.isclose(one[above], other[above], rtol=1e-3, atol=1e-5)
        assert close.mean() > 0.999  # a half vector at the border of a cell may change it


def test_its_twin_is_black_where_a_direction_is_not_a_number(small):
    """A bump map may turn a frame by 0 / 0; an exception would end Mitsuba's picture."""
    twin, up = MitsubaProbe(merl(small)), np.array([[0.0, 0.0, 1.0]])
    nowhere = np.full((1, 3), np.nan)
    for wo, wi in ((nowhere, up), (up, nowhere), (nowhere, nowhere)):
        f_cos, pdf = twin.eval_pdf(wo, wi)
        assert not f_cos.any() and not pdf.any()
    found = twin.sample(nowhere, np.array([[0.3, 0.4, 0.5]]))
    assert not found.weight.any() and not found.pdf.any()


def test_its_albedo_is_mitsubas(small):
    """A plate: pi f of light along the normal, as Mitsuba's for BSDFs without an own."""
    plate = {"type": "rectangle", "bsdf": merl(small)}
    view = sensor((0.3, 0.4, 3), (0, 0, 0), up=(0, 1, 0))
    content = scene(view, "aov", plate, aovs="a:albedo")
    albedo = renderer.render(renderer.load_dict(content), spp=1).aovs["a"][0, 0]
    wo = np.array([[0.3, 0.4, 3.0]]) / np.sqrt(9.25)
    theirs, _ = MitsubaProbe(merl(small)).eval_pdf(wo, np.array([[0.0, 0.0, 1.0]]))
    np.testing.assert_allclose(albedo, np.pi * theirs[0], rtol=1e-3)


# ------------------------------------------------------------------------- sampling


@pytest.mark.parametrize("seen", [0, 20])
def test_half_vectors_come_as_often_as_the_density_says(seen, small):
    """Chi-square over the cells of theta_h, of half of the azimuths each.

    The density jumps where a cell ends and where wi goes under the horizon, so the grid
    has the table's own edges and ends before: at 35 degrees less half of `seen`.
    """
    n = 1 << 17
    probe, wo = BsdfProbe(merl(small)), seen_under(seen, 30.0)
    numbers = np.random.default_rng(11).random((n, 3))
    wi = probe.sample(wo, numbers).wi
    h = wi + wo
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    edges = edges_of_half_vectors(12)
    edges = edges[edges < np.radians(35 - seen / 2)]
    half = np.arctan2(np.hypot(h[:, 0], h[:, 1]), h[:, 2])
    azimuths = np.linspace(0, 2 * np.pi, 9)
    azimuth = np.arctan2(h[:, 1], h[:, 0]) % (2 * np.pi)

    def density(theta, phi):
        """Per unit of theta and phi: a half vector covers 4 cos of the directions."""
        sine = np.sin(theta)
        half = np.stack((sine * np.cos(phi), sine * np.sin(phi), np.cos(theta)), axis=1)
        cosine = half @ wo[0]
        mirrored = 2 * cosine[:, None] * half - wo
        return probe.eval_pdf(wo, mirrored)[1] * 4 * cosine * sine

    masses = cell_masses(density, edges, azimuths)
    counts = histogram(half, azimuth, edges, azimuths)
    assert_follows(counts, masses, n, finds=0.1, mass=masses.sum(), tests=2)
