"""Fresnel, reflection, refraction, diffuse: closed forms, float64 and Mitsuba."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_probes import directions, float32
from scatter_probes import dielectric64
from scene_file_samples import mi

from renderer.kernels.jit import entry_kernel, pack
from renderer.kernels.lanes.memory import load_row, store_row
from renderer.kernels.lanes.vectors import load3, orthonormal_basis, store3
from renderer.plugins.bsdfs.diffuse import DIFFUSE
from renderer.plugins.bsdfs.fresnel import fresnel_conductor, fresnel_dielectric
from renderer.plugins.bsdfs.kind import BsdfMethods
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


def fresnel(cos_i, eta, k=0.0):
    """Four rows of float64, see `run_fresnel`."""
    rows = np.broadcast_arrays(*(np.atleast_1d(np.float32(a)) for a in (cos_i, eta, k)))
    n = rows[0].size
    rows = [np.pad(a, (0, -n % 16), constant_values=0.5) for a in rows]
    out = np.empty((4, rows[0].size), np.float32)
    run_fresnel(*rows, out)
    return out[:, :n].astype(float)


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


# ------------------------------------------------------------------------- conductor


METALS = [
    (0.2, 3.9),
    (1.1, 2.6),
    (0.0, 1.0),
    (3.2, 3.3),
    (1.5, 0.0),
    (0.05, 6.0),
    (2.9, 0.01),
]


def test_a_perfect_mirror_reflects_everything():
    """eta 0, k 1 is what the file's material `none` means."""
    np.testing.assert_allclose(fresnel(np.linspace(0, 1, 101), 0.0, 1.0)[3], 1, rtol=1e-6)


ROUNDING = 2.0**-24
both_sides = pytest.mark.parametrize("side", [1, -1], ids=["front", "back"])


INDICES = (1.0003, 1.01, 1.1, 1.333, 1.5, 1.5046, 2.4, 3.5, 0.999, 0.9, 2 / 3, 0.5)
COSINES = np.concatenate((np.linspace(0, 1, 4001), 10 ** np.linspace(-8, 0, 1001)))


@both_sides
@pytest.mark.parametrize("index", INDICES)
def test_glass_reflects_as_complex_numbers_say_to_the_last_bits(index, side):
    """Mixed error bound: right to 6 roundings for inputs that are wrong by 2 roundings.

    The reflectance lies, up to 6 x 2^-24 of itself, within the range that the exact formula
    takes when cosine and index change by 2 x 2^-24 of themselves (measured: 4.6). A plain
    bound would be useless at the critical angle, where the curve is a root; thousands of
    cosines there are part of the grid.
    """
    index = np.float32(index)
    ratio = float(index) if side > 0 else 1 / float(index)
    critical = np.sqrt(max(1 - ratio**2, 0.0))
    steps = np.concatenate((np.linspace(-1e-3, 1e-3, 2001), np.linspace(-1e-6, 1e-6, 201)))
    cosine = np.unique(np.float32(np.append(COSINES, critical * (1 + steps))))
    got = fresnel(side * cosine, index)[0]
    wide = cosine.astype(float)
    near = [
        dielectric64(wide * (1 + i * ROUNDING), ratio * (1 + j * ROUNDING))
        for i in (-2, 0, 2)
        for j in (-2, 0, 2)
    ]
    low, high = np.min(near, axis=0), np.max(near, axis=0)
    assert (got >= low * (1 - 6 * ROUNDING)).all()
    assert (got <= high * (1 + 6 * ROUNDING)).all()


METALS = [(0.2, 3.9), (1.1, 2.6), (3.2, 3.3), (1.5, 0), (0.05, 6), (2.9, 0.01), (0.143, 4)]


@pytest.mark.parametrize(("eta", "k"), METALS)
def test_metals_reflect_as_complex_numbers_say(eta, k):
    """Within 64 x 2^-24 = 3.8e-6 on a fine grid (measured: 44, for eta 0.05, k 6)."""
    cosine, eta, k = np.float32(COSINES), np.float32(eta), np.float32(k)
    got = fresnel(cosine, eta, k)[3]
    expected = dielectric64(cosine.astype(float), float(eta) + 1j * float(k))
    np.testing.assert_allclose(got, expected, rtol=0, atol=64 * ROUNDING)


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


# --------------------------------------------------------------------------- diffuse
