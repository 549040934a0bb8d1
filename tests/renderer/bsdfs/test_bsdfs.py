"""Fresnel, reflection, refraction, diffuse: closed forms, float64 and Mitsuba."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_probes import chi_square_z, directions, float32, mean_z, unit
from scene_file_samples import mi

from renderer.kernels.jit import entry_kernel, pack
from renderer.kernels.lanes.memory import load_row, store_row
from renderer.kernels.lanes.vectors import load3, orthonormal_basis, store3, vec3
from renderer.plugins.bsdfs.diffuse import DIFFUSE, Diffuse, eval_pdf, sample
from renderer.plugins.bsdfs.fresnel import fresnel_conductor, fresnel_dielectric
from renderer.plugins.bsdfs.kind import BsdfMethods, Numbers
from renderer.plugins.bsdfs.mirror import reflect, refracted
from renderer.plugins.sampling.numbers_and_warps import Frame, Plain, to_local, to_world


@entry_kernel
def run_fresnel(cos_i, eta, k, out):
    """Rows: dielectric reflectance, refracted cosine, crossing; conductor reflectance."""
    for i in range(0, cos_i.size, 16):
        c, n = load_row(cos_i, 0, i), load_row(eta, 0, i)
        reflectance, cos_t, crossing = fresnel_dielectric(c, n)
        store_row(out, 0, i, reflectance)
        store_row(out, 1, i, cos_t)
        store_row(out, 2, i, crossing)
        store_row(out, 3, i, fresnel_conductor(c, n, load_row(k, 0, i)))


@entry_kernel
def run_mirror(bsdf, wo, normal, eta, mirrored, bent):
    for i in range(0, eta.size, 16):
        w, n = load3(wo, i), load3(normal, i)
        s, t = orthonormal_basis(n)
        local, index = to_local(Frame(s, t, n), w), load_row(eta, 0, i)
        _, cos_t, _ = fresnel_dielectric(local.z, index)
        store3(mirrored, i, reflect(w, n))
        wi = refracted(bsdf.arithmetic, local, index, cos_t)
        store3(bent, i, to_world(bsdf.arithmetic, Frame(s, t, n), wi))


@entry_kernel
def run_diffuse(bsdf, normal, x, y, wi, cosines, f):
    """Directions around normals; rows of cosines: of the sample, its pdf."""
    for i in range(0, x.size, 16):
        n = load3(normal, i)
        s, t = orthonormal_basis(n)
        u, v = load_row(x, 0, i), load_row(y, 0, i)
        diffuse = Diffuse(vec3(0.25, 0.5, 1.0) + 0.0 * n)
        chosen = sample(diffuse, n, Numbers(u, v, u, bsdf.arithmetic))
        store3(wi, i, to_world(bsdf.arithmetic, Frame(s, t, n), chosen.wi))
        f_cos, pdf = eval_pdf(diffuse, n, chosen.wi)
        store_row(cosines, 0, i, chosen.wi.z)
        store_row(cosines, 1, i, pdf)
        store3(f, i, f_cos)


def fresnel(cos_i, eta, k=0.0):
    """Four rows of float64, see `run_fresnel`."""
    rows = np.broadcast_arrays(*(np.atleast_1d(np.float32(a)) for a in (cos_i, eta, k)))
    n = rows[0].size
    rows = [np.pad(a, (0, -n % 16), constant_values=0.5) for a in rows]
    out = np.empty((4, rows[0].size), np.float32)
    run_fresnel(*rows, out)
    return out[:, :n].astype(float)


def dielectric64(cos_i, n):
    """Fresnel's equations from outside by complex square roots."""
    sin2 = 1 - cos_i**2
    far = np.sqrt(n**2 - sin2 + 0j)  # n cos_t
    s = (cos_i - far) / (cos_i + far)
    p = (n**2 * cos_i - far) / (n**2 * cos_i + far)
    return 0.5 * (np.abs(s) ** 2 + np.abs(p) ** 2)


# ------------------------------------------------------------------------ dielectric


@pytest.mark.parametrize(
    ("degrees", "expected"),
    [
        (0, 0.04),
        (30, 0.0415226),
        (45, 0.0502399),
        (56.30993, 0.0739645),
        (60, 0.0891867),
        (80, 0.3877044),
        (85, 0.6127996),
        (89, 0.90418),
        (89.9, 0.98991),
    ],
)
def test_glass_from_outside(degrees, expected):
    """n = 1.5, ground truth row M and row 20."""
    cosine = np.float32(np.cos(np.radians(degrees)))
    got = fresnel(cosine, 1.5)[0, 0]
    assert got == pytest.approx(expected, rel=2e-5)


@pytest.mark.parametrize(
    ("degrees", "expected"), [(41.81, 0.97986), (41.82, 1.0), (60.0, 1.0)]
)
def test_total_internal_reflection(degrees, expected):
    """From inside n = 1.5 all light stays beyond 41.8103 degrees (row 19)."""
    cosine = -np.cos(np.radians(degrees))
    got = fresnel(cosine, 1.5)[0, 0]
    # at 41.81 the reflectance grows by 0.3 % for one unit of the cosine
    assert got == expected if expected == 1 else got == pytest.approx(expected, abs=3e-3)


def test_beyond_the_critical_angle_it_is_one_exactly():
    """For many indices, and never a NaN from the root of a negative number."""
    rng = np.random.default_rng(0)
    n = np.float32(rng.uniform(1.01, 3, 10_000))
    critical = np.sqrt(1 - 1 / n.astype(float) ** 2)
    cosine = -critical * rng.uniform(0, 0.999, n.size)
    reflectance, far, _, _ = fresnel(cosine, n)
    np.testing.assert_array_equal(reflectance, 1)
    np.testing.assert_array_equal(far, 0)


def test_against_complex_numbers_in_float64():
    """From outside and from inside, indices below and above 1."""
    rng = np.random.default_rng(1)
    n = np.float32(rng.uniform(0.4, 3, 20_000))
    cosine = np.float32(rng.uniform(-1, 1, n.size))
    reflectance, far, crossing, _ = fresnel(cosine, n)
    wide_n, wide_c = n.astype(float), cosine.astype(float)
    relative = np.where(wide_c >= 0, wide_n, 1 / wide_n)
    np.testing.assert_allclose(crossing, relative, rtol=2e-7)
    cos2_t = 1 - (1 - wide_c**2) / relative**2
    clear = np.abs(cos2_t) > 1e-3  # the root is steep at the critical angle
    expected = dielectric64(np.abs(wide_c), relative)
    np.testing.assert_allclose(reflectance[clear], expected[clear], atol=2e-5)
    assert ((reflectance >= 0) & (reflectance <= 1)).all()
    cos_t = -np.sign(wide_c) * np.sqrt(np.maximum(cos2_t, 0))
    np.testing.assert_allclose(far[clear], cos_t[clear], atol=2e-5)


def test_against_mitsuba_s_dielectric():
    """Reflectance, refracted cosine and index ratio of `mi.fresnel`, number by number."""
    rng = np.random.default_rng(2)
    n = np.float32(rng.uniform(0.5, 2.5, 2000))
    cosine = np.float32(rng.uniform(-1, 1, n.size))
    theirs = np.array(
        [mi.fresnel(c, e)[:3] for c, e in zip(cosine.tolist(), n.tolist(), strict=True)]
    )
    reflectance, far, crossing, _ = fresnel(cosine, n)
    clear = np.abs(theirs[:, 1]) > 0.03
    np.testing.assert_allclose(reflectance[clear], theirs[clear, 0], atol=5e-6)
    np.testing.assert_allclose(far[clear], theirs[clear, 1], atol=5e-6)
    np.testing.assert_allclose(crossing, theirs[:, 2], rtol=2e-7)


def test_the_ends_of_the_range():
    """Grazing incidence reflects all, equal indices nothing; no NaN at 0 or above 1."""
    cosine = np.array([0.0, -0.0, 1.0, -1.0, 1.0000001, 1e-20, 1e-8])
    for n in (1.5, 1 / 1.5, 1.0):
        rows = fresnel(cosine, n)
        assert np.isfinite(rows[:3]).all()
        expected = [0.0] * 7 if n == 1 else [1.0, 1.0, 0.04, 0.04, 0.04, 1.0, 1.0]
        np.testing.assert_allclose(rows[0], expected, atol=1e-6)


def test_snell_s_law():
    """sin_i = n sin_t for 0 to 90 degrees (row 20), squared as small sines are lost."""
    degrees = np.linspace(0, 90, 721)
    cosine = np.float32(np.cos(np.radians(degrees)))
    far = fresnel(cosine, 1.5)[1]
    sin2_i, sin2_t = (1 - a.astype(float) ** 2 for a in (cosine, far))
    np.testing.assert_allclose(sin2_i, 1.5**2 * sin2_t, atol=5e-7)


# ------------------------------------------------------------------------- conductor


def conductor64(cos_i, eta, k):
    """The same equations with a complex index of refraction."""
    return dielectric64(cos_i, eta + 1j * k)


METALS = [
    (0.2, 3.9),
    (1.1, 2.6),
    (0.0, 1.0),
    (3.2, 3.3),
    (1.5, 0.0),
    (0.05, 6.0),
    (2.9, 0.01),
]


@pytest.mark.parametrize(("eta", "k"), METALS)
def test_metals_against_complex_numbers_and_mitsuba(eta, k):
    cosine = np.float32(np.linspace(0, 1, 1001))
    got = fresnel(cosine, eta, k)[3]
    wide = cosine.astype(float)
    n, kappa = float(np.float32(eta)), float(np.float32(k))
    expected = conductor64(wide, n, kappa) if (eta, k) != (0.0, 1.0) else np.ones(1001)
    np.testing.assert_allclose(got, expected, atol=3e-5)
    complex_index = mi.Complex2f(eta, k)
    theirs = [mi.fresnel_conductor(c, complex_index) for c in cosine[::20].tolist()]
    np.testing.assert_allclose(got[::20], theirs, atol=3e-5)


def test_a_perfect_mirror_reflects_everything():
    """eta 0, k 1 is what the file's material `none` means."""
    np.testing.assert_allclose(fresnel(np.linspace(0, 1, 101), 0.0, 1.0)[3], 1, rtol=1e-6)


def test_a_metal_without_absorption_is_a_dielectric():
    rows = fresnel(np.linspace(0.01, 1, 500), 1.5, 0.0)
    np.testing.assert_allclose(rows[3], rows[0], atol=2e-6)


# -------------------------------------------------------------------------- geometry


def mirrored(wo, normal, eta):
    n = len(wo)
    out = np.empty((2, 3, n), np.float32)
    eta = np.ascontiguousarray(np.broadcast_to(np.float32(eta), n))
    methods = pack(BsdfMethods(DIFFUSE.form(), Plain()))
    run_mirror(methods, float32(wo.T), float32(normal.T), eta, *out)
    return out[0].T.astype(float), out[1].T.astype(float)


def random_sides(n=16_384, seed=3):
    rng = np.random.default_rng(seed)
    return directions(n, rng), directions(n, rng)


def test_reflection():
    """Unit length, in the plane of incidence, at the same angle; twice: itself."""
    wo, normal = random_sides()
    reflected, _ = mirrored(wo, normal, 1.5)
    np.testing.assert_allclose(np.linalg.norm(reflected, axis=1), 1, rtol=1e-6)
    cosine = np.sum(wo * normal, axis=1, keepdims=True)
    np.testing.assert_allclose(reflected, 2 * cosine * normal - wo, atol=5e-7)
    again, _ = mirrored(reflected, normal, 1.5)
    np.testing.assert_allclose(again, wo, atol=2e-6)


@pytest.mark.parametrize("eta", [1.5, 1 / 1.5, 2.4, 1.0])
def test_refraction(eta):
    """Snell's law as vectors: the tangent shrinks by the index ratio, the side changes."""
    wo, normal = random_sides()
    _, refracted = mirrored(wo, normal, eta)
    cosine = np.sum(wo * normal, axis=1)
    ratio = np.where(cosine >= 0, eta, 1 / eta)
    tangent = wo - cosine[:, None] * normal
    passes = np.sum(tangent**2, axis=1) < 0.999 * ratio**2
    assert passes.mean() > 0.2
    np.testing.assert_allclose(np.linalg.norm(refracted[passes], axis=1), 1, rtol=1e-6)
    far = np.sum(refracted * normal, axis=1)
    assert (np.sign(far) == -np.sign(cosine))[passes].all()
    new_tangent = refracted - far[:, None] * normal
    expected = -tangent / ratio[:, None]
    np.testing.assert_allclose(new_tangent[passes], expected[passes], atol=5e-6)


def test_light_finds_its_way_back():
    """Refracted into glass and back out: the direction that it came from."""
    wo, normal = random_sides()
    wo *= np.sign(np.sum(wo * normal, axis=1, keepdims=True))
    _, inside = mirrored(wo, normal, 1.5)
    _, back = mirrored(inside, normal, 1.5)
    grazing = np.sum(wo * normal, axis=1) < 0.02
    np.testing.assert_allclose(back[~grazing], wo[~grazing], atol=2e-5)


# --------------------------------------------------------------------------- diffuse


def diffuse_samples(normal, n=1 << 16, seed=4):
    x, y = np.random.default_rng(seed).random((2, n)).astype(np.float32)
    wi, f = np.empty((3, n), np.float32), np.empty((3, n), np.float32)
    cosines = np.empty((2, n), np.float32)
    normals = float32(np.repeat(np.reshape(normal, (3, 1)), n, axis=1))
    bsdf = pack(BsdfMethods(DIFFUSE.form(), Plain()))
    run_diffuse(bsdf, normals, x, y, wi, cosines, f)
    return wi.T.astype(float), cosines.astype(float), f.T.astype(float)


@pytest.mark.parametrize(
    "normal", [[0, 0, 1], [0, 0, -1], [1, 2, 3], [-1, 0, 1e-4]], ids=str
)
def test_diffuse_directions_have_density_cos_over_pi(normal):
    """cos^2 uniform, longitude uniform; the pdf and f cos agree with the sample.

    False alarm rate 3e-6 for the histogram, which finds a tilt of 8 % with 99 %; see
    tests/renderer/bsdfs/test_bsdf_samplers.py for a sharper one.
    """
    normal = unit(normal)
    wi, (cosine, pdf), f = diffuse_samples(normal)
    np.testing.assert_allclose(np.linalg.norm(wi, axis=1), 1, rtol=5e-7)
    np.testing.assert_allclose(wi @ normal, cosine, atol=5e-7)
    assert cosine.min() >= 0
    counts = np.histogram(cosine**2, 64, (0, 1))[0]
    assert chi_square_z(counts) < 4.5
    sideways = np.cross(normal, [0.3, 0.5, -0.7])
    assert abs(mean_z(wi @ sideways, 0)) < 4.5
    np.testing.assert_allclose(pdf, cosine / np.pi, rtol=3e-7)
    # f cos / pdf is the albedo: no noise
    shining = pdf > 0
    np.testing.assert_allclose(
        f[shining] / pdf[shining, None],
        np.tile([0.25, 0.5, 1], (shining.sum(), 1)),
        rtol=3e-7,
    )
