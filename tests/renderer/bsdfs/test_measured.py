"""The measured BSDF `measured`: its file, its warps, and tables of a known material.

The metal is that of tests/plugins/make_measured.py. The file that it writes is in the tests
of all BSDFs, too.
"""

from __future__ import annotations

import struct
import tracemalloc
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from bsdf_probes import BsdfProbe, MitsubaProbe, random_directions, seen_under
from chi_square import assert_follows, gauss_masses, histogram
from plugins.make_measured import Metal, elevations, main, measured_fields
from scipy import integrate

import renderer
from renderer.errors import SceneError
from renderer.plugins.bsdfs.measured_file import read_measured
from renderer.plugins.bsdfs.tensor_file import MOST_NUMBERS, tensor_file
from renderer.simple.materials import bsdf_at
from renderer.simple.measured import BilinearDensity

COPPER = Path(__file__).parents[2] / "plugins" / "copper_rgb.bsdf"
BRUSHED = Metal(0.25, 0.5)
SECTORS = {  # azimuths of files of every symmetry
    "full": np.linspace(-np.pi, np.pi, 9),
    "half": np.linspace(-np.pi, 0.0, 5),
    "quarter": np.linspace(-np.pi, -np.pi / 2, 3),
    "two": [0.0, 0.4],  # isotropic
}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("measured")
    for name, phi_i in SECTORS.items():
        fields = measured_fields(BRUSHED, phi_i, elevations(4), jacobian=name != "half")
        (folder / f"{name}_rgb.bsdf").write_bytes(tensor_file(fields))
    return folder


def measured(path):
    return {"type": "measured", "filename": str(path)}


# ------------------------------------------------------------------------ the file


def test_the_file_is_the_one_that_the_script_makes(tmp_path):
    main(tmp_path)
    made, there = (
        read_measured(folder / COPPER.name) for folder in (tmp_path, COPPER.parent)
    )
    np.testing.assert_allclose(made.rgb, there.rgb, rtol=1e-5)
    np.testing.assert_allclose(made.vndf.values, there.vndf.values, rtol=1e-5)


def test_densities_integrate_to_one(files):
    found = read_measured(files / "half_rgb.bsdf")
    assert not found.isotropic and found.sectors == 2 and not found.jacobian
    for density in (found.vndf, found.luminance):
        np.testing.assert_allclose(density.rows[..., -1], 1.0, rtol=1e-6)
        along = np.trapezoid(density.values, dx=1.0 / density.columns.shape[-1])
        np.testing.assert_allclose(density.columns[..., -1], along, rtol=1e-6)


def changed(**fields):
    """Return the file with other fields; those that are None are left out."""
    given = (
        measured_fields(Metal(0.4, 0.4), [0.0], elevations(3), normals_at=(4, 5)) | fields
    )
    return tensor_file({name: a for name, a in given.items() if a is not None})


def part(name, index, value):
    a = measured_fields(Metal(0.4, 0.4), [0.0], elevations(3), normals_at=(4, 5))[
        name
    ].copy()
    a[index] = value
    return changed(**{name: a})


def header(count=1, name=b"ndf", rank=2, kind=10, offset=100, shape=(4, 4)):
    """Return a header of one field, with 64 numbers behind it."""
    fields = struct.pack("<IH", count, len(name)) + name
    fields += struct.pack(f"<HBQ{len(shape)}Q", rank, kind, offset, *shape)
    return b"tensor_file\0\1\0" + fields + bytes(256)


F32 = np.float32
WRONG = {
    "empty": (b"", "begins with b''; expected"),
    "text": (b"<scene version='3.0.0'/>", 'expected "tensor_file" of version 1.0'),
    "of another version": (b"tensor_file\0\2\0" + bytes(40), "of version 1.0"),
    "without a count": (b"tensor_file\0\1\0\1", "ends within its header, after 15 bytes"),
    "of too many fields": (header(count=1 << 31), "at most 256 are possible"),
    "that ends in its header": (header()[:40], "ends within its header"),
    "of an unknown type": (
        header(kind=77),
        "type 77 and rank 2; possible are types 1 to 11",
    ),
    "of too many axes": (header(rank=9), "ranks up to 8"),
    "of too many numbers": (header(shape=(1 << 40, 1 << 40)), f"at most {MOST_NUMBERS}"),
    "of more numbers than it has": (
        header(shape=(100, 9)),
        "ends at byte 3700; the file has",
    ),
    "beyond its end": (header(offset=1 << 63), "ends at byte 9223372036854775872"),
    "of another thing": (tensor_file({"a": np.ones(3, F32)}), "has no field description,"),
    "without colours": (changed(rgb=None), r"has no field rgb; it has .*; needed are"),
    "without flag": (changed(jacobian=None), "has no field jacobian"),
    "of spectra": (changed(wavelengths=np.ones(4, F32)), r"spectra .* with _rgb\.bsdf"),
    "of flat colours": (changed(rgb=np.ones((3, 5, 5), F32)), "rgb: found 3 axes of type"),
    "of doubles": (
        changed(ndf=np.ones((4, 5))),
        "ndf: found 2 axes of type float64; expected",
    ),
    "of two flags": (changed(jacobian=np.ones(2, np.uint8)), r"found the shape \(2,\)"),
    "of four colours": (
        changed(rgb=np.ones((1, 3, 4, 5, 5), F32)),
        r"expected \(1, 3, 3, 5, 5",
    ),
    "of other places": (
        changed(rgb=np.ones((1, 3, 3, 5, 6), F32)),
        r"expected \(1, 3, 3, 5, 5",
    ),
    "of an oblong": (
        changed(luminance=np.ones((1, 3, 5, 6), F32)),
        r"expected \(1, 3, 5, 5\)",
    ),
    "of other angles": (changed(vndf=np.ones((1, 2, 4, 5), F32)), r"vndf: found the shape"),
    "of one row": (changed(sigma=np.ones((1, 4), F32)), "expected at least 2 along"),
    "of no angle": (
        changed(
            **{"phi_i": np.ones(0, F32), "vndf": np.ones((0, 3, 4, 5), F32)},
            **{
                "luminance": np.ones((0, 3, 5, 5), F32),
                "rgb": np.ones((0, 3, 3, 5, 5), F32),
            },
        ),
        "phi_i: found the shape .* expected at least 1 along",
    ),
    "with NaN": (
        part("ndf", (1, 2), np.nan),
        "ndf: found nan; expected at most 1e.09",
    ),
    "with an infinity": (part("rgb", (0, 0, 1, 2, 3), -np.inf), "rgb: found inf; expected"),
    "with equal angles": (
        part("theta_i", 1, 0.0),
        "theta_i: found 0 after 0; expected increasing angles",
    ),
    "with a negative density": (
        part("vndf", (0, 1, 1, 1), -0.5),
        "vndf: found -0.5; expected",
    ),
    "with a negative area": (part("sigma", (1, 1), -2.0), "sigma: found -2; expected"),
    "without light": (part("luminance", (0, 1), 0.0), "luminance: found a density that"),
    "of a tiny density": (part("vndf", (0, 1), 1e-42), "vndf: found a density that"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_file_is_one_sentence_that_says_where(name, tmp_path):
    content, says = WRONG[name]
    (tmp_path / "wrong_rgb.bsdf").write_bytes(content)
    scene = tmp_path / "scene.xml"
    scene.write_text(
        '<scene version="3.0.0"><sensor type="perspective"/>\n<shape type="sphere">\n'
        '<bsdf type="measured"><string name="filename" value="wrong_rgb.bsdf"/></bsdf>\n'
        "</shape></scene>"
    )
    with pytest.raises(SceneError, match=says) as caught:
        renderer.load_file(scene)
    text = str(caught.value)
    assert "scene.xml:3" in text and '"measured"' in text and "wrong_rgb.bsdf: " in text
    assert text.isprintable()


def test_a_file_cut_anywhere_is_refused(tmp_path):
    content, path = changed(), tmp_path / "cut_rgb.bsdf"
    for end in [*range(0, 500, 7), *range(500, len(content), 41), len(content) - 1]:
        path.write_bytes(content[:end])
        with pytest.raises(SceneError, match="cut_rgb"):
            read_measured(path)


def test_a_header_that_lies_takes_no_memory(tmp_path):
    """Fields may overlap, but each is smaller than the file."""
    path = tmp_path / "large_rgb.bsdf"
    path.write_bytes(header(shape=(1 << 12, 1 << 12), offset=0))
    tracemalloc.start()
    with pytest.raises(SceneError, match="the file has"):
        read_measured(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 1 << 20


def test_a_missing_file_or_none_is_an_error():
    for bsdf in ({"type": "measured"}, measured("nowhere.bsdf")):
        content = {"type": "scene", "shape": {"type": "sphere", "bsdf": bsdf}}
        with pytest.raises(SceneError, match=r"filename|nowhere"):
            renderer.load_dict({**content, "sensor": {"type": "perspective"}})


# ------------------------------------------------------------------------- the warps


def test_the_textbooks_warp_is_inverted():
    rng = np.random.default_rng(3)
    density = BilinearDensity(rng.random((4, 6)))
    for x, y in rng.random((20, 2)):
        assert density.numbers_of(*density.place_of(x, y)) == pytest.approx((x, y))


@pytest.mark.parametrize("name", [name for name in SECTORS if name != "two"])
def test_mitsubas_values_densities_and_samples(name, files):
    """Isotropic or not, with the azimuths of a full turn or a part, next to another table.

    Mitsuba's places within a patch lose digits where the patch is nearly even, so that one
    direction in a hundred is off by more than 1e-5. An isotropic file of two azimuths is
    left out: Mitsuba then uses a number that it never sets (docs/mitsuba-faults.md, 37).
    """
    bsdf = measured(files / f"{name}_rgb.bsdf")
    ours, theirs = BsdfProbe(bsdf, (measured(COPPER),)), MitsubaProbe(bsdf)
    rng = np.random.default_rng(4)
    wo, wi = (random_directions(2000, rng, both_sides=False) for _ in range(2))
    numbers = rng.random((2000, 3)).astype(np.float32)
    mine, other = ours.sample(wo, numbers), theirs.sample(wo, numbers)
    wi[::2] = mine.wi[::2]
    for a, b in zip(ours.eval_pdf(wo, wi), theirs.eval_pdf(wo, wi), strict=True):
        np.testing.assert_allclose(a, b, rtol=5e-5, atol=1e-7)
    alive = other.weight.any(axis=1)
    np.testing.assert_array_equal(alive, mine.weight.any(axis=1))
    assert alive.mean() > 0.8
    for a, b in ((mine.wi, other.wi), (mine.weight, other.weight), (mine.pdf, other.pdf)):
        error = (np.abs(a - b) / (np.abs(b) + 0.01))[alive]
        assert np.median(error) < 3e-6
        assert np.quantile(error, 0.98) < 1e-4


@pytest.mark.parametrize("name", SECTORS)
def test_the_simple_renderer_says_the_same(name, files):
    """In double precision, with sums and bisections instead of tables of integrals."""
    probe = BsdfProbe(measured(files / f"{name}_rgb.bsdf"))
    simple = bsdf_at(probe.description, SimpleNamespace(uv=(0.0, 0.0)))
    rng = np.random.default_rng(5)
    wo, wi = (random_directions(60, rng, both_sides=False) for _ in range(2))
    numbers = rng.random((60, 3)).astype(np.float32)
    found = probe.sample(wo, numbers)
    f_cos, pdf = probe.eval_pdf(wo, wi)
    for k, (o, i) in enumerate(zip(wo.astype(float), wi.astype(float), strict=True)):
        expected = simple.eval_pdf(o, i)
        np.testing.assert_allclose(f_cos[k], expected[0], rtol=5e-5, atol=1e-7)
        assert pdf[k] == pytest.approx(expected[1], rel=5e-5)
        sample = simple.sample(o, tuple(map(float, numbers[k])))
        np.testing.assert_allclose(found.weight[k], sample.weight, rtol=1e-4)
        if sample.weight.any():
            np.testing.assert_allclose(found.wi[k], sample.wi, atol=1e-4)
            assert found.pdf[k] == pytest.approx(sample.pdf, rel=1e-3)


@pytest.mark.parametrize("name", ["half", "quarter"])
def test_directions_follow_the_density(name, files):
    """Chi-square of 2^16 directions of an anisotropic material, seen obliquely."""
    probe, wo, count = (
        BsdfProbe(measured(files / f"{name}_rgb.bsdf")),
        seen_under(50),
        1 << 16,
    )
    out = probe.sample(wo, np.random.default_rng(6).random((count, 3)).astype(np.float32))
    above = out.pdf > 0.0
    azimuth = np.arctan2(out.wi[:, 1], out.wi[:, 0]) % (2.0 * np.pi)
    cosines, turn = np.linspace(0.0, 1.0, 13), np.linspace(0.0, 2.0 * np.pi, 25)

    def density(cosine, phi):
        sine = np.sqrt(1.0 - cosine**2)
        wi = np.stack((sine * np.cos(phi), sine * np.sin(phi), cosine), axis=1)
        return probe.eval_pdf(wo, wi)[1]

    masses = gauss_masses(density, cosines, turn, 24)
    assert masses.sum() == pytest.approx(above.mean(), abs=5e-3)
    counts = histogram(out.wi[above, 2], azimuth[above], cosines, turn)
    assert_follows(counts, masses, count, finds=0.2, mass=masses.sum(), stray=20, tests=2)


# ------------------------------------------------------------------------- the material


def test_a_known_metal_comes_back(tmp_path):
    """Fine tables of a rough metal give its formula, F D G / (4 cos_o).

    Linear interpolation between 9 x 9 places of colours is off by 3 % on average.
    """
    metal = Metal(0.4, 0.4)
    fields = measured_fields(metal, [0.0], elevations(16), normals_at=(65, 64), colors_at=9)
    path = tmp_path / "fine_rgb.bsdf"
    path.write_bytes(tensor_file(fields))
    probe = BsdfProbe(measured(path))
    rng = np.random.default_rng(7)
    wo, wi = (random_directions(4000, rng, both_sides=False) for _ in range(2))
    m = (wo + wi) / np.linalg.norm(wo + wi, axis=1, keepdims=True)
    model = metal.tint(m, wo) * (metal.distribution(m) / (4.0 * metal.area(wo)))[:, None]
    found, _ = probe.eval_pdf(wo, wi)
    clear = (wo[:, 2] > 0.15) & (wi[:, 2] > 0.15)
    error = np.abs(found - model)[clear] / model[clear].mean()
    assert np.mean(error) < 0.04
    assert found[clear].mean() == pytest.approx(model[clear].mean(), rel=0.02)


def test_light_is_the_integral_of_what_is_evaluated():
    """Weights of samples add up to the quadrature of f cos, where no luminance is 0."""
    probe, wo = BsdfProbe(measured(COPPER)), seen_under(40.0)
    numbers = np.random.default_rng(8).random((1 << 15, 3)).astype(np.float32)
    sampled = probe.sample(np.repeat(wo, len(numbers), 0), numbers).weight.mean(axis=0)
    cosines = np.linspace(0.0, 1.0, 401)
    phi = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    sine = np.sqrt(1.0 - cosines**2)[:, None]
    z = np.broadcast_to(cosines[:, None], (401, 400))
    wi = np.stack((sine * np.cos(phi), sine * np.sin(phi), z), axis=-1).reshape(-1, 3)
    f_cos = probe.eval_pdf(wo, wi)[0].reshape(401, 400, 3).mean(axis=1) * 2.0 * np.pi
    np.testing.assert_allclose(
        sampled, integrate.simpson(f_cos, x=cosines, axis=0), rtol=5e-3
    )
