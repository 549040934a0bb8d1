"""BSDFs called one by one, ours and Mitsuba's: a dictionary, directions, random numbers.

Directions are local, (n, 3), and named as ours: `wo` is where the path comes from. A kernel
compiles once for each kind of BSDF, whatever its parameters are.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scene_file_samples import mi

import renderer
from renderer.kernels.jit import entry_kernel, pack
from renderer.kernels.lanes.memory import load_row, store_row
from renderer.kernels.lanes.vectors import load3, store3
from renderer.plugins.bsdfs.kind import (
    DELTA,
    SMOOTH,
    STRAIGHT,
    BsdfMethods,
    Numbers,
    eval_pdf_bsdf,
    lobe_of,
    sample_bsdf,
)
from renderer.plugins.bsdfs.normalmap import frame_along
from renderer.plugins.bsdfs.parameters import parameters_at
from renderer.plugins.sampling.numbers_and_warps import Plain
from renderer.scene.materials import MaterialTables, kind_of

Array = NDArray[np.float64]


class Points(NamedTuple):
    """What `parameters_at` looks at."""

    parameters: NDArray[np.float32]
    bsdf: NDArray[np.int32]


@entry_kernel
def run_eval(bsdf, points, wo, wi, f_cos, pdf):
    for i in range(0, pdf.size, 16):
        parameters = parameters_at(bsdf.form, points, i)
        f, density = eval_pdf_bsdf(parameters, load3(wo, i), load3(wi, i))
        store3(f_cos, i, f)
        store_row(pdf, 0, i, density)


@entry_kernel
def run_sample(bsdf, points, wo, numbers, wi, weight, pdf_eta, lobe):
    for i in range(0, numbers.shape[1], 16):
        drawn = Numbers(
            load_row(numbers, 0, i),
            load_row(numbers, 1, i),
            load_row(numbers, 2, i),
            bsdf.arithmetic,
        )
        parameters = parameters_at(bsdf.form, points, i)
        chosen = sample_bsdf(parameters, load3(wo, i), drawn)
        store3(wi, i, chosen.wi)
        store3(weight, i, chosen.weight)
        store_row(pdf_eta, 0, i, chosen.pdf + 0.0 * chosen.weight.x)
        store_row(pdf_eta, 1, i, chosen.eta + 0.0 * chosen.weight.x)
        store_row(lobe, 0, i, lobe_of(chosen))


@entry_kernel
def run_frame_along(normal, x, axes):
    for i in range(0, normal.shape[1], 16):
        frame, _ = frame_along(load3(normal, i), load3(x, i))
        store3(axes[0], i, frame.s)
        store3(axes[1], i, frame.t)
        store3(axes[2], i, frame.n)


def frames_along(normal: Array, x: Array) -> NDArray[np.float32]:
    """Return the axes (3, 3, n) of frames around normals whose s is along x, (3, n)."""
    axes = np.zeros((3, *normal.shape), np.float32)
    run_frame_along(normal.astype(np.float32), x.astype(np.float32), axes)
    return axes


class Sampled(NamedTuple):
    """Directions that a BSDF chose; of those that it did not find the weight is 0."""

    wi: Array  # (n, 3)
    weight: Array  # (n, 3)
    pdf: Array  # (n,) [1/sr], or of a delta lobe its probability
    eta: Array  # (n,)
    lobe: Array  # (n,) SMOOTH, DELTA or STRAIGHT


class BsdfProbe:
    """A BSDF of ours.

    Parameters
    ----------
    bsdf : dict
        As in `load_dict`, of a kind that scatters by itself (nothing around another).
    earlier : tuple of dict
        Other BSDFs of the scene, which come before it.
    arithmetic
        Record of the rounding of directions; `AsMitsuba` is that of a replay.
    """

    def __init__(
        self,
        bsdf: dict[str, Any],
        earlier: tuple[dict[str, Any], ...] = (),
        arithmetic: Any = None,
    ):
        plates = {
            f"plate{k}": {"type": "rectangle", "bsdf": one}
            for k, one in enumerate((*earlier, bsdf))
        }
        content = {"type": "scene", "camera": {"type": "perspective"}, **plates}
        materials: MaterialTables = renderer.load_dict(content).materials
        self.id = len(earlier)
        self.description = materials.bsdfs[self.id]
        self.kind = kind_of(self.description)
        form = self.kind.form(materials.tables_of(self.kind))
        self._bsdf = pack(BsdfMethods(form, arithmetic or Plain()))
        self._values = materials.values()[:, self.id]

    def _points(self, n: int) -> Any:
        values = np.repeat(self._values[:, None], n, axis=1)
        return pack(Points(values, np.full(n, self.id, np.int32)))

    def eval_pdf(self, wo: Any, wi: Any) -> tuple[Array, Array]:
        """Return f |cos| (n, 3) and the density (n,) [1/sr]."""
        a, b = np.broadcast_arrays(wo, wi)
        n, a, b = len(a), _columns(a), _columns(b)
        f_cos, pdf = np.empty_like(a), np.empty(a.shape[1], np.float32)
        run_eval(self._bsdf, self._points(a.shape[1]), a, b, f_cos, pdf)
        return f_cos[:, :n].T.astype(float), pdf[:n].astype(float)

    def sample(self, wo: Any, numbers: Any) -> Sampled:
        """Sample with rows x, y, choice of numbers (n, 3) in [0, 1)."""
        a, _ = np.broadcast_arrays(wo, numbers)
        n, a, u = len(a), _columns(a), _columns(numbers)
        wi, weight = np.empty_like(a), np.empty_like(a)
        rest = np.empty((2, a.shape[1]), np.float32)
        lobe = np.empty(a.shape[1], np.int32)
        run_sample(self._bsdf, self._points(a.shape[1]), a, u, wi, weight, rest, lobe)
        rows = (x[..., :n].astype(float) for x in (wi, weight, rest[0], rest[1]))
        wi, weight, pdf, eta = rows
        return Sampled(wi.T, weight.T, pdf, eta, lobe[:n])


def _columns(rows: Any) -> NDArray[np.float32]:
    """Return (n, 3) as (3, n), padded to whole registers."""
    padded = np.pad(np.asarray(rows, np.float32), ((0, -len(rows) % 16), (0, 0)), "edge")
    return np.ascontiguousarray(padded.T)


class MitsubaProbe:
    """The same BSDF in Mitsuba (`scalar_rgb`), one direction at a time."""

    def __init__(self, bsdf: dict[str, Any]) -> None:
        self.bsdf = mi.load_dict(bsdf)
        self._point = mi.SurfaceInteraction3f()
        self._context = mi.BSDFContext()

    def eval_pdf(self, wo: Any, wi: Any) -> tuple[Array, Array]:
        """Return f |cos| (n, 3) and the density (n,) [1/sr]."""
        rows = []
        for a, b in zip(*(x.tolist() for x in np.broadcast_arrays(wo, wi)), strict=True):
            self._point.wi = a
            f, pdf = self.bsdf.eval_pdf(self._context, self._point, b)
            rows.append((*f, pdf))
        table = np.array(rows, float)
        return table[:, :3], table[:, 3]

    def sample(self, wo: Any, numbers: Any) -> Sampled:
        """Sample with rows x, y, choice of numbers (n, 3)."""
        rows = []
        wo, _ = np.broadcast_arrays(wo, numbers)
        for a, (x, y, choice) in zip(wo.tolist(), numbers.tolist(), strict=True):
            self._point.wi = a
            s, weight = self.bsdf.sample(self._context, self._point, choice, (x, y))
            lobe = mi.BSDFFlags(s.sampled_type or 2)
            straight = mi.has_flag(lobe, mi.BSDFFlags.Null)
            delta = DELTA if mi.has_flag(lobe, mi.BSDFFlags.Delta) else SMOOTH
            kind = STRAIGHT if straight else delta
            rows.append((*s.wo, *weight, s.pdf, s.eta, kind))
        table = np.array(rows, float)
        return Sampled(table[:, :3], table[:, 3:6], *table[:, 6:].T)


# ----------------------------------------------------------------------------- directions


def random_directions(n: int, rng: Any, *, both_sides: bool) -> NDArray[np.float32]:
    """Return unit vectors (n, 3) of float32, one in ten of them near the horizon."""
    v = rng.standard_normal((n, 3))
    v[: n // 10, 2] *= 0.05
    if not both_sides:
        v[:, 2] = np.abs(v[:, 2])
    v = rng.permutation(v)
    return (v / np.linalg.norm(v, axis=1, keepdims=True)).astype(np.float32)


def seen_under(degrees: float, azimuth: float = 40.0, *, below: bool = False) -> Array:
    """Return one unit vector (1, 3) at an angle to the normal."""
    theta, phi = np.radians((degrees, azimuth))
    x, y = np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi)
    return np.array([[x, y, -np.cos(theta) if below else np.cos(theta)]])


# --------------------------------------------------------------------------------- energy


def even_numbers(n: int) -> Array:
    """Return n^2 triples: a grid in x and y, choices spread by the golden ratio."""
    x = (np.arange(n) + 0.5) / n
    pairs = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)
    choice = np.arange(n * n) * (np.sqrt(5.0) - 1.0) / 2.0 % 1.0
    return np.column_stack((pairs, choice))


def albedo(probe: BsdfProbe | MitsubaProbe, wo: Array, n: int) -> Array:
    """Return what share of light along `wo` (1, 3) goes on, by n^2 even samples; (3,).

    Reflected and transmitted; without the squeeze of radiance by eta^2.
    """
    numbers = even_numbers(n)
    out = probe.sample(np.repeat(wo, len(numbers), 0), numbers)
    return np.asarray((out.weight * out.eta[:, None] ** 2).mean(axis=0))
