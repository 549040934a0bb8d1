"""Scattering stages run from Python on points whose angles are chosen."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from kernel_probes import Inputs
from numpy.typing import NDArray

import renderer
from renderer.integrators.kind import NO_LIMIT
from renderer.integrators.stages.branch_specular import branch_specular
from renderer.integrators.stages.camera_rays import camera_rays
from renderer.integrators.stages.materials import load_parameters
from renderer.integrators.stages.scatter import scatter
from renderer.kernels.jit import entry_kernel, pack
from renderer.kernels.lanes.memory import load_row, store_row
from renderer.kernels.lanes.vectors import store3, vec3
from renderer.kernels.records.batch import CAPACITY, Rays, Tile, Workspace
from renderer.kernels.records.kernel_scene import RECORD
from renderer.plugins.bsdfs.diffuse import Diffuse, eval_pdf
from renderer.plugins.sampling.numbers_and_warps import (
    Independent,
)
from renderer.rendering.planning.make_plan import make_plan

Array = NDArray[np.float64]
TILE = Tile(0, 0, 32, 32, 32)
UP = (0.0, 0.0, 1.0)


@entry_kernel
def run_scatter(scene, tile, sample, work):
    """Scatter at the points of the only kind of BSDF; return how many paths go on."""
    bsdfs, ends, none = scene.bsdfs, work.ends, np.int64(0)
    load_parameters(scene.shapes, bsdfs, none, work.points, ends[0], ends[1])
    return scatter(scene, tile, sample, none, work)


@entry_kernel
def run_split(scene, work):
    """Follow all branches at the points; return how many there are."""
    bsdfs, ends, none = scene.bsdfs, work.ends, np.int64(0)
    load_parameters(scene.shapes, bsdfs, none, work.points, ends[0], ends[1])
    return branch_specular(scene, work, none)


@entry_kernel
def run_camera_rays(scene, tile, sample, work):
    return camera_rays(scene, tile, sample, work, np.int64(0))


class Scattered(NamedTuple):
    """What became of n paths, `samples` times; NaN where a path has ended."""

    direction: NDArray[np.float32]  # (samples, n, 3)
    weight: NDArray[np.float32]  # (samples, n, 3)
    pdf: NDArray[np.float32]  # (samples, n) [1/sr], 0 for mirrors
    eta: NDArray[np.float32]  # (samples, n) relative index that was crossed


def _columns(rays: Rays, end: int) -> NDArray[np.float32]:
    rows = np.concatenate((rays.direction, rays.throughput, [rays.pdf], [rays.eta]))
    return rows[:, :end].T


def _named(table: NDArray[np.float32]) -> Scattered:
    return Scattered(table[..., :3], table[..., 3:6], table[..., 6], table[..., 7])


class ScatterProbe:
    """A BSDF on a plate, evaluated at the stage that renders.

    Parameters
    ----------
    bsdf : dict
        As in `load_dict`.
    roulette : bool
        Whether Russian roulette is played at the first bounce.
    """

    def __init__(self, bsdf: dict[str, Any], *, roulette: bool = False) -> None:
        plate = {"type": "rectangle", "bsdf": bsdf}
        content = {"type": "scene", "camera": {"type": "perspective"}, "plate": plate}
        scene = renderer.load_dict(content)
        depth = 1 if roulette else NO_LIMIT
        inputs = Inputs(scene, make_plan(scene, integrator="path"))
        self.inputs = inputs.with_settings(roulette_depth=depth, dim_depth=depth)

    def _filled(self, inputs: Inputs, wo: Array, normal: Any) -> Workspace:
        """Return a workspace with points seen from `wo`, on shape 0."""
        work, n = inputs.workspace(), len(wo)
        p = work.points
        p.wo[:, :n] = wo.T
        for row in (p.normal, p.shading_normal):
            row[:, :n] = np.broadcast_to(normal, (n, 3)).T
        p.throughput[:], p.eta[:] = 1, 1
        p.slot[:n] = np.arange(n)
        work.ends[:] = 0, n
        return work

    def scatter(
        self, wo: Any, *, normal: Any = UP, samples: int = 1, seed: float = 0
    ) -> Scattered:
        """Scatter paths seen from `wo` (n, 3), n <= 1024.

        The normal is a unit vector; other seeds are other random numbers.
        """
        wo = np.atleast_2d(np.asarray(wo, float))
        n = len(wo)
        numbers = pack(Independent(int(1000 * seed)))
        sampler = self.inputs.record.sampler.copy()
        sampler[0, RECORD] = numbers.address
        inputs = self.inputs.changed(sampler=sampler)
        work = self._filled(inputs, wo, normal)
        packed, rays = pack(work), work.rays
        out = np.full((samples, n, 8), np.nan, np.float32)
        for sample in range(samples):
            end = run_scatter(inputs.packed, TILE, sample, packed)
            out[sample, rays.slot[:end]] = _columns(rays, end)
        return _named(out)

    def split(self, wo: Any) -> tuple[Scattered, Scattered]:
        """Return the reflected and the refracted rays of a glass (Whitted's two)."""
        wo = np.atleast_2d(np.asarray(wo, float))
        scene = self.inputs.scene
        inputs = Inputs(scene, make_plan(scene, integrator="whitted"))
        inputs = inputs.with_settings(cutoff=0.0)
        out = np.full((2, 1, len(wo), 8), np.nan, np.float32)
        for k, one in enumerate(wo):
            work = self._filled(inputs, one[None], UP)
            end = run_split(inputs.packed, pack(work))
            out[:end, 0, k] = _columns(work.rays, end)  # the reflected one comes first
        return _named(out[0]), _named(out[1])

    def film_positions(self, samples: int) -> Array:
        """Return positions on the film (2, samples, 1024), in pixels."""
        out = np.empty((2, samples, CAPACITY), np.float32)
        work = self.inputs.workspace()
        for sample in range(samples):
            run_camera_rays(self.inputs.packed, TILE, sample, pack(work))
            out[:, sample] = work.film[:2, :CAPACITY]
        return out.astype(float)


# --------------------------------------------------------------------- what is evaluated


def seen_at(degrees: Any, side: int = 1) -> Array:
    """Return unit vectors (n, 3) at angles to the normal +z, or to -z for side -1."""
    theta = np.radians(np.atleast_1d(degrees))
    return np.stack((np.sin(theta), 0 * theta, side * np.cos(theta)), axis=1)


def two_sided(**bsdf: Any) -> ScatterProbe:
    return ScatterProbe({"type": "twosided", "bsdf": bsdf})


def clear_glass(**colors: Any) -> ScatterProbe:
    return ScatterProbe({"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0, **colors})


def undone(out: Scattered) -> Array:
    """Return weights (samples, n, 3) without the squeeze of radiance by eta^2."""
    return out.weight * out.eta[..., None].astype(float) ** 2


@entry_kernel
def run_eval_diffuse(albedo, cosine, f_cos, pdf):
    for i in range(0, cosine.size, 16):
        c = load_row(cosine, 0, i)
        none = c * 0.0
        color = vec3(none + albedo[0], none + albedo[1], none + albedo[2])
        f, density = eval_pdf(Diffuse(color), vec3(none, none, c), vec3(none, none, c))
        store3(f_cos, i, f)
        store_row(pdf, 0, i, density)


def diffuse_pdf(cosine: Any) -> Array:
    """Return the density [1/sr] that the diffuse BSDF states for n cosines."""
    return _stated((1.0, 1.0, 1.0), cosine)[1]


def _stated(albedo: Any, cosine: Any) -> tuple[Array, Array]:
    padded = np.pad(np.float32(cosine), (0, -len(cosine) % 16))
    f_cos, pdf = np.empty((3, padded.size), np.float32), np.empty_like(padded)
    run_eval_diffuse(np.float32(albedo), padded, f_cos, pdf)
    n = len(cosine)
    return f_cos[:, :n].astype(float), pdf[:n].astype(float)


def dielectric64(cos_i, n):
    """Fresnel's equations from outside by complex square roots."""
    sin2 = 1 - cos_i**2
    far = np.sqrt(n**2 - sin2 + 0j)  # n cos_t
    s = (cos_i - far) / (cos_i + far)
    p = (n**2 * cos_i - far) / (n**2 * cos_i + far)
    return 0.5 * (np.abs(s) ** 2 + np.abs(p) ** 2)
