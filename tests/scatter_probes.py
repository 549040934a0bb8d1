"""Scattering stages run from Python on points whose angles are chosen."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from kernel_probes import workspace
from numpy.typing import NDArray
from renderer.kernel_inputs import kernel_scene

import renderer
from renderer.jit import entry_kernel
from renderer.kinds.bsdfs.diffuse import eval_diffuse
from renderer.lanes.functions import lane_index
from renderer.lanes.memory import load_row, store_row
from renderer.lanes.vectors import store3, vec3
from renderer.records.batch import CAPACITY, Rays, Workspace
from renderer.records.kernel_scene import KernelScene
from renderer.rendering.planning.plan import make_plan
from renderer.stages.camera_rays import film_position
from renderer.stages.film import Tile
from renderer.stages.scatter import (
    scatter_conductor,
    scatter_dielectric,
    scatter_diffuse,
    split_dielectric,
)

Array = NDArray[np.float64]
TILE = Tile(0, 0, 32, 32, 32)
UP = (0.0, 0.0, 1.0)


@entry_kernel
def run_diffuse(scene, tile, sample, points, count, rays):
    bsdfs, settings = scene.bsdfs, scene.settings
    return scatter_diffuse(
        bsdfs.diffuse, scene.sampler, settings, scene.shapes, bsdfs.kind, tile, sample,
        0, points, 0, count, rays, 0,
    )  # fmt: skip


@entry_kernel
def run_conductor(scene, tile, sample, points, count, rays):
    bsdfs, settings = scene.bsdfs, scene.settings
    return scatter_conductor(
        bsdfs.conductor, scene.sampler, settings, scene.shapes, bsdfs.kind, tile, sample,
        0, points, 0, count, rays, 0,
    )  # fmt: skip


@entry_kernel
def run_dielectric(scene, tile, sample, points, count, rays):
    bsdfs, settings = scene.bsdfs, scene.settings
    return scatter_dielectric(
        bsdfs.dielectric, scene.sampler, settings, scene.shapes, bsdfs.kind, tile, sample,
        0, points, 0, count, rays, 0,
    )  # fmt: skip


@entry_kernel
def run_split(scene, tile, sample, points, count, rays):
    bsdfs = scene.bsdfs
    return split_dielectric(
        bsdfs.dielectric,
        scene.settings,
        scene.shapes,
        bsdfs.kind,
        points,
        0,
        count,
        rays,
        0,
    )


@entry_kernel
def run_film_position(sampler, tile, sample, x, y):
    for i in range(0, x.size, 16):
        px, py = film_position(sampler, tile, lane_index() + i, sample)
        store_row(x, 0, i, px)
        store_row(y, 0, i, py)


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
    """A BSDF on a plate, asked at the stage that renders.

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
        inputs = kernel_scene(scene, make_plan(scene, integrator="path"), "brute", 0)
        settings = inputs.settings._replace(roulette_depth=1 if roulette else None)
        self.inputs: KernelScene = inputs._replace(settings=settings)

    def _fill(self, work: Workspace, wo: Array, normal: Any) -> None:
        p, n = work.points, len(wo)
        p.wo[:, :n] = wo.T
        for row in (p.normal, p.shading_normal):
            row[:, :n] = np.broadcast_to(normal, (n, 3)).T
        p.throughput[:], p.eta[:] = 1, 1
        p.slot[:n] = np.arange(n)

    def scatter(
        self, run: Any, wo: Any, *, normal: Any = UP, samples: int = 1, seed: float = 0
    ) -> Scattered:
        """Scatter paths seen from `wo` (n, 3), n <= 1024, by one of the `run_*`.

        The normal is a unit vector; other seeds are other random numbers.
        """
        wo = np.atleast_2d(np.asarray(wo, float))
        n = len(wo)
        work = workspace(2 * CAPACITY)
        self._fill(work, wo, normal)
        rays = work.rays
        sampler = self.inputs.sampler._replace(seed=int(1000 * seed))
        inputs = self.inputs._replace(sampler=sampler)
        out = np.full((samples, n, 8), np.nan, np.float32)
        for sample in range(samples):
            end = run(inputs, TILE, sample, work.points, n, rays)
            out[sample, rays.slot[:end]] = _columns(rays, end)
        return _named(out)

    def split(self, wo: Any) -> tuple[Scattered, Scattered]:
        """Return the reflected and the refracted rays of a glass (Whitted's two)."""
        wo = np.atleast_2d(np.asarray(wo, float))
        work = workspace(2 * CAPACITY)
        out = np.full((2, 1, len(wo), 8), np.nan, np.float32)
        for k, one in enumerate(wo):
            self._fill(work, one[None], UP)
            end = run_split(self.inputs, TILE, 0, work.points, 1, work.rays)
            out[:end, 0, k] = _columns(work.rays, end)  # the reflected one comes first
        return _named(out[0]), _named(out[1])

    def film_positions(self, samples: int) -> Array:
        """Return positions on the film (2, samples, 1024), in pixels."""
        out = np.empty((2, samples, CAPACITY), np.float32)
        for sample in range(samples):
            run_film_position(
                self.inputs.sampler, TILE, sample, out[0, sample], out[1, sample]
            )
        return out.astype(float)


# -------------------------------------------------------------------------- what is asked


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
def run_eval_diffuse(albedo, cosine, f_cos):
    for i in range(0, cosine.size, 16):
        c = load_row(cosine, 0, i)
        one = c * 0.0 + 1.0
        color = vec3(one * albedo[0], one * albedo[1], one * albedo[2])
        store3(f_cos, i, eval_diffuse(color, c))


def diffuse_f_cos(albedo: Any, cosine: Any) -> Array:
    """Return what `eval_diffuse` states for n cosines, (3, n)."""
    padded = np.pad(np.float32(cosine), (0, -len(cosine) % 16))
    f_cos = np.empty((3, padded.size), np.float32)
    run_eval_diffuse(np.float32(albedo), padded, f_cos)
    return f_cos[:, : len(cosine)].astype(float)
