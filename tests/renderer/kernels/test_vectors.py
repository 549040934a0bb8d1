"""`renderer.kernels.lanes.vectors`: vectors of lanes and of scalars against NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from numba.core.errors import TypingError

from renderer.kernels.jit import entry_kernel
from renderer.kernels.lanes.functions import first_lanes, lane
from renderer.kernels.lanes.memory import load_row, store_row
from renderer.kernels.lanes.vectors import (
    append3,
    column,
    cross,
    dot,
    gather3,
    length,
    load3,
    normalize,
    orthonormal_basis,
    select3,
    store3,
    vec3,
)

N = 64


@pytest.fixture
def arrays():
    return np.random.default_rng(0).standard_normal((2, 3, N)).astype(np.float32)


@entry_kernel
def arithmetic(a, b, s, t, x):
    """Vectors a and b, scalars s, t = 2 s as lanes or not, and a vector x of scalars."""
    return (
        *(a + b, a - b, a * b, a / b, -a, a * s, s * a, a / s, s / a, a + s, s - a),
        *(a * t, t * a, a / t, t / a, a + x, x - a, x * t, x / t, a * 0.1, 1 / a),
    )


@entry_kernel
def run_lanes(a, b, s, t, out):
    for i in range(0, t.size, 16):
        row = 0
        given = (load3(a, i), load3(b, i), s, load_row(t, 0, i), column(b, 0))
        for result in arithmetic(*given):
            store3(out[row], i, result)
            row += 1


@entry_kernel
def run_scalars(a, b, s, t, out):
    for i in range(t.size):
        row = 0
        for v in arithmetic(column(a, i), column(b, i), s, t[i], column(b, 0)):
            out[row, 0, i] = v.x
            out[row, 1, i] = v.y
            out[row, 2, i] = v.z
            row += 1


@pytest.mark.parametrize("run", [run_lanes, run_scalars], ids=["lanes", "scalars"])
def test_operators_work_component_by_component(arrays, run):
    """Exactly NumPy's bits in float32, whichever side a number stands on."""
    a, b = arrays
    s = np.float32(0.7)
    t = np.full(N, 2 * s)
    with_numpy = arithmetic.py_func(a, b, s, t, b[:, :1] + 0 * a)
    got = np.empty((len(with_numpy), 3, N), np.float32)
    run(a, b, s, t, got)
    if run is run_lanes:
        np.testing.assert_array_equal(got, np.stack(with_numpy))
    else:  # scalar literals are float64 in a kernel, as everywhere in Numba
        np.testing.assert_allclose(got, np.stack(with_numpy), rtol=2e-7)


@entry_kernel
def run_products(a, b, scalars, vectors):
    for i in range(0, N, 16):
        p, q = load3(a, i), load3(b, i)
        store_row(scalars, 0, i, dot(p, q))
        store_row(scalars, 1, i, length(p))
        store3(vectors[0], i, cross(p, q))
        store3(vectors[1], i, normalize(p))
        store3(vectors[2], i, select3(p.x < q.x, p, q))
        store3(vectors[3], i, vec3(p.x, 0, 1.5))


def test_products_norms_and_choice(arrays):
    a, b = arrays
    scalars, vectors = np.empty((2, N), np.float32), np.empty((4, 3, N), np.float32)
    run_products(a, b, scalars, vectors)
    wide_a, wide_b = arrays.astype(np.float64)
    norm = np.linalg.norm(wide_a, axis=0)
    np.testing.assert_allclose(scalars[0], (wide_a * wide_b).sum(0), rtol=0, atol=1e-6)
    np.testing.assert_allclose(scalars[1], norm, rtol=3e-7)
    np.testing.assert_allclose(vectors[0], np.cross(wide_a.T, wide_b.T).T, atol=2e-6)
    np.testing.assert_allclose(vectors[1], wide_a / norm, rtol=3e-7)
    np.testing.assert_array_equal(vectors[2], np.where(a[0] < b[0], a, b))
    np.testing.assert_array_equal(vectors[3], [a[0], np.zeros(N), np.full(N, 1.5)])


@entry_kernel
def run_bases(normals, tangents, bitangents):
    for i in range(0, normals.shape[1], 16):
        s, t = orthonormal_basis(load3(normals, i))
        store3(tangents, i, s)
        store3(bitangents, i, t)


@entry_kernel
def run_scalar_bases(normals, tangents, bitangents):
    for i in range(normals.shape[1]):
        s, t = orthonormal_basis(column(normals, i))
        tangents[0, i], tangents[1, i], tangents[2, i] = s.x, s.y, s.z
        bitangents[0, i], bitangents[1, i], bitangents[2, i] = t.x, t.y, t.z


def directions():
    """Random ones, the axes with both signs of zero, and those next to n.z = -1 and 0."""
    normals = np.random.default_rng(1).standard_normal((3, 1024))
    signs = np.array([1, -1])[np.indices((2, 2, 2)).reshape(3, 8)]
    normals[:, :24] = np.concatenate([np.eye(3)[:, [k]] * signs for k in range(3)], axis=1)
    normals[:, 24:28] = [
        [1e-20, 1e-4, 0.6, 0.6],
        [0, 1e-7, 0.8, 0.8],
        [-1, -1, 1e-9, -1e-9],
    ]
    return (normals / np.linalg.norm(normals, axis=0)).astype(np.float32)


@pytest.mark.parametrize("run", [run_bases, run_scalar_bases], ids=["lanes", "scalars"])
def test_orthonormal_basis_is_one(run):
    """Unit length, right angles and right-handed to 1e-6, at n.z = -1 and -0.0 as well."""
    normals = directions()
    assert (np.signbit(normals[2]) & (normals[2] == 0)).any() and (normals[2] == -1).any()
    tangents, bitangents = np.empty((2, *normals.shape), np.float32)
    run(normals, tangents, bitangents)
    frames = np.stack((tangents, bitangents, normals)).astype(np.float64).transpose(2, 0, 1)
    identity = np.broadcast_to(np.eye(3), frames.shape)
    np.testing.assert_allclose(frames @ frames.transpose(0, 2, 1), identity, atol=1e-6)
    np.testing.assert_allclose(np.linalg.det(frames), 1, atol=1e-6)


@entry_kernel
def run_memory(a, indices, gathered, appended):
    index = load_row(indices, 0, 0)
    mask = first_lanes(16) & (index > 20)
    v = gather3(a, index, mask)
    store3(gathered, 0, v)
    append3(appended, 1, v, mask)


def test_gather_and_append(arrays):
    indices = np.random.default_rng(2).integers(0, N, 16).astype(np.int32)
    gathered, appended = np.zeros((3, 16), np.float32), np.zeros((3, 32), np.float32)
    run_memory(arrays[0], indices, gathered, appended)
    kept = indices > 20
    np.testing.assert_array_equal(gathered, np.where(kept, arrays[0][:, indices], 0))
    end = 1 + kept.sum()
    np.testing.assert_array_equal(appended[:, 1:end], arrays[0][:, indices[kept]])
    assert (appended[:, 0] == 0).all()


@entry_kernel
def mix_precisions(a, d):
    return lane(vec3(load_row(a, 0, 0), load_row(d, 0, 0), 0.0).x, 0)


def test_components_of_two_precisions_do_not_compile():
    with pytest.raises(TypingError):
        mix_precisions(np.zeros(16, np.float32), np.zeros(16, np.float64))


def test_vec3_belongs_to_kernels():
    with pytest.raises(TypeError, match="kernels only"):
        vec3(1, 2, 3)
