"""The rays of the study of accelerators, in batches as of a picture of one sample a pixel.

Of more samples the renderer puts those of a pixel side by side, up to 16: its rays lie
closer then than these. Four kinds, from orderly to disorderly: camera rays (16 neighbours
are 4 x 4 pixels), shadow rays from their hits to one light, diffuse rays from their hits,
and random rays from anywhere to anywhere.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from renderer.kernels.records.batch import CAPACITY, PADDING
from renderer.plugins.shapes.primitives import unit_normals
from reports.trials.meshes import StudyMesh, View

TILE = 32  # pixels a side: one batch
BLOCK = 4  # pixels a side: one packet

Rows = NDArray[np.float32]  # (n, 3)


class RayKind(NamedTuple):
    """How one kind of rays is traced."""

    coherent: bool  # 16 in a row go the same way
    any_hit: bool  # whether something is in the way is all that is wanted


RAY_KINDS = {
    # through neighbouring pixels
    "camera": RayKind(True, False),
    # from their hits to one point light
    "shadow": RayKind(True, True),
    "shadow_nearest": RayKind(True, False),
    # from their hits, distributed by the cosine
    "diffuse": RayKind(False, False),
    # from anywhere in the ball around the mesh in any direction
    "random": RayKind(False, False),
}


class RayBatches(NamedTuple):
    """Rays in batches of `CAPACITY`, the last one shorter."""

    origin: NDArray[np.float32]  # (batches, 3, CAPACITY + PADDING)
    direction: NDArray[np.float32]  # (batches, 3, CAPACITY + PADDING) unit
    t_max: NDArray[np.float32]  # (batches, CAPACITY + PADDING)
    count: NDArray[np.int64]  # type: ignore[assignment]  # (batches,) rays in each

    @property
    def rays(self) -> int:
        """How many rays there are."""
        return int(self.count.sum())

    def rows(self) -> tuple[Rows, Rows, NDArray[np.float32]]:
        """Return origins (n, 3), directions (n, 3) and ends (n,) as rows."""
        return flat(self.origin, self), flat(self.direction, self), flat(self.t_max, self)


def flat(values: NDArray[Any], batches: RayBatches) -> NDArray[Any]:
    """Return values by batch, (batches, [3,] stride), as rows by ray, (n, [3])."""
    used = values[..., :CAPACITY]
    rows = np.moveaxis(used, 1, -1) if used.ndim == 3 else used
    rows = rows.reshape(-1, *rows.shape[2:])[: batches.rays]
    return np.ascontiguousarray(rows)


def in_batches(origin: ArrayLike, direction: ArrayLike, t_max: ArrayLike) -> RayBatches:
    """Cut rays (n, 3), (n, 3), (n,) or one end for all, into batches."""
    o, d = np.asarray(origin, np.float32), np.asarray(direction, np.float32)
    n = len(d)
    batches = -(-n // CAPACITY)
    stride = CAPACITY + PADDING
    ends = np.zeros((batches, stride), np.float32)
    rows = np.zeros((2, batches, 3, stride), np.float32)
    padded = np.zeros((batches * CAPACITY, 3), np.float32)
    for k, values in enumerate((o, d)):
        padded[:n] = values
        rows[k, :, :, :CAPACITY] = padded.reshape(batches, CAPACITY, 3).swapaxes(1, 2)
    padded[:n, 0] = t_max
    ends[:, :CAPACITY] = padded[:, 0].reshape(batches, CAPACITY)
    counts = np.full(batches, CAPACITY)
    counts[-1] = n - CAPACITY * (batches - 1)
    return RayBatches(rows[0], rows[1], ends, counts)


# -------------------------------------------------------------------------- camera rays


def pixel_order(width: int, height: int) -> NDArray[np.int64]:
    """Return pixel numbers, row-wise from the top left, in the order of the rays.

    Tile by tile, in each 4 x 4 block by block, as the renderer's tiles.
    """
    y, x = np.divmod(np.arange(width * height), width)
    keys = (
        x % BLOCK,
        y % BLOCK,
        x % TILE // BLOCK,
        y % TILE // BLOCK,
        x // TILE,
        y // TILE,
    )
    return np.lexsort(keys)


def camera_rays(view: View, width: int, height: int) -> RayBatches:
    """Return one ray through the middle of each pixel, in `pixel_order`."""
    eye = np.array(view.eye)
    forward = np.array(view.target) - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, view.up)
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    pixel = 2.0 * np.tan(np.radians(view.fov) / 2.0) / max(width, height)
    y, x = np.divmod(pixel_order(width, height), width)
    across = (x + 0.5 - width / 2.0) * pixel
    below = (y + 0.5 - height / 2.0) * pixel
    direction = forward + across[:, None] * right + below[:, None] * down
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return in_batches(np.broadcast_to(eye, direction.shape), direction, np.inf)


# ----------------------------------------------------------- rays that start at hit points


class HitPoints(NamedTuple):
    """Where camera rays met the mesh."""

    position: NDArray[np.float64]  # (n, 3), moved off the surface
    normal: NDArray[np.float64]  # (n, 3) unit, towards the camera


def hit_points(
    mesh: StudyMesh, camera: RayBatches, t: NDArray[np.float32], prim: NDArray[np.int32]
) -> HitPoints:
    """Return the points of all camera rays that hit; t and prim are (n,) by ray."""
    origin, direction, _ = camera.rows()
    hit = np.flatnonzero(prim >= 0)
    corner, second, third = (mesh.vertices[mesh.faces[prim[hit], k]] for k in range(3))
    normal = unit_normals((second - corner).T, (third - corner).T).T.astype(np.float64)
    towards = direction[hit].astype(np.float64)
    normal *= np.where(np.sum(normal * towards, axis=1) > 0.0, -1.0, 1.0)[:, None]
    position = origin[hit] + t[hit, None].astype(np.float64) * towards
    # Far enough off the surface that rounding in no test lets a ray hit where it
    # starts: a ten thousandth of the way, and 256 units in the last place.
    off = np.maximum(1e-4 * t[hit], 2.0**-16 * np.abs(position).max(axis=1))
    return HitPoints(position + off[:, None] * normal, normal)


def shadow_rays(points: HitPoints, light: ArrayLike) -> RayBatches:
    """Return one ray from each point to a point light, which ends just before it."""
    to_light = np.asarray(light, np.float64) - points.position
    distance = np.linalg.norm(to_light, axis=1)
    return in_batches(
        points.position, to_light / distance[:, None], distance * (1.0 - 1e-4)
    )


def diffuse_rays(points: HitPoints, seed: int = 1) -> RayBatches:
    """Return one ray from each point, distributed by the cosine to the normal."""
    generator = np.random.default_rng(seed)
    # The normal plus a point of the unit sphere around its tip is distributed by the
    # cosine; the sphere is a little smaller, so that the sum is never 0.
    direction = points.normal + 0.999 * directions(len(points.normal), generator)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return in_batches(points.position, direction, np.inf)


def random_rays(mesh: StudyMesh, count: int, seed: int = 2) -> RayBatches:
    """Return rays from points of the sphere around the mesh in all directions."""
    generator = np.random.default_rng(seed)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    centre, radius = (low + high) / 2.0, np.linalg.norm(high - low) / 2.0
    share = generator.random((count, 1)) ** (1.0 / 3.0)
    origin = centre + radius * share * directions(count, generator)
    return in_batches(origin, directions(count, generator), np.inf)


def directions(count: int, generator: np.random.Generator) -> NDArray[np.float64]:
    """Return uniformly distributed unit vectors (count, 3)."""
    v = generator.normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)
