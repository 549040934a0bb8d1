"""Lights asked from Python: samples, densities, choices; one place for their signatures."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import numpy as np
from kernel_probes import float32
from numpy.typing import NDArray
from renderer.kernel_inputs import kernel_scene
from renderer.kinds.lights.choose import choose_light, sample_light

import renderer
from renderer.jit import entry_kernel
from renderer.kinds.lights.area import pdf_area_light
from renderer.lanes.memory import load_row, store_row
from renderer.lanes.vectors import load3, store3
from renderer.rendering.planning.plan import make_plan

Array = NDArray[np.float64]


@entry_kernel
def run_sample_light(lights, surfaces, light, position, random, vectors, scalars):
    """Rows of `vectors`: wi, radiance; of `scalars`: distance, pdf."""
    for i in range(0, light.size, 16):
        which = load_row(light, 0, i)
        x, y, z = load_row(random, 0, i), load_row(random, 1, i), load_row(random, 2, i)
        s = sample_light(lights, surfaces, which, load3(position, i), x, y, z)
        store3(vectors[:3], i, s.wi)
        store3(vectors[3:], i, s.radiance)
        store_row(scalars, 0, i, s.distance)
        store_row(scalars, 1, i, s.pdf)


@entry_kernel
def run_pdf_area_light(areas, surfaces, light, prim, position, distance, cosine, pdf):
    for i in range(0, light.size, 16):
        which, met = load_row(light, 0, i), load_row(prim, 0, i)
        r, cos = load_row(distance, 0, i), load_row(cosine, 0, i)
        where = load3(position, i)
        density = pdf_area_light(areas, surfaces, which, met, which >= 0, where, r, cos)
        store_row(pdf, 0, i, density)


@entry_kernel
def run_choose_light(lights, number, light):
    for i in range(0, number.size, 16):
        x = load_row(number, 0, i)
        store_row(light, 0, i, choose_light(lights, None, None, 0, x, x)[0])


class Sampled(NamedTuple):
    """n directions to a light, float64."""

    wi: Array  # (n, 3)
    radiance: Array  # (n, 3) over the density
    distance: Array  # (n,)
    pdf: Array  # (n,) [1/sr]


class LightProbe:
    """A scene of lights of many kinds, asked one light at a time.

    Parameters
    ----------
    shapes, emitters : dict
        Area lights without their emitter, and other lights, by name, as in `load_dict`.
    radiance : tuple of 3 floats
        Of all area lights.
    replay : bool
        Whether lights are asked as in a replay of Mitsuba.
    """

    def __init__(
        self,
        shapes: dict[str, Any],
        emitters: dict[str, Any],
        radiance: tuple[float, float, float],
        *,
        replay: bool = False,
    ) -> None:
        shine = {"type": "area", "radiance": {"type": "rgb", "value": list(radiance)}}
        shining = {name: {**shape, "emitter": shine} for name, shape in shapes.items()}
        camera = {"type": "perspective"}
        content = {"type": "scene", "camera": camera, **shining, **emitters}
        self.scene = renderer.load_dict(content)
        plan = make_plan(self.scene, integrator="path")
        plan = dataclasses.replace(plan, replay=replay)
        inputs = kernel_scene(self.scene, plan, "brute", 0)
        self.lights, self.surfaces = inputs.lights, inputs.surfaces
        self.names = [*shapes, *emitters]

    def prims(self, name: str) -> NDArray[np.int64]:
        """Return the primitive ids of a light's shape."""
        return np.flatnonzero(self.scene.shape == self.names.index(name))

    def _light(self, name: str, n: int) -> NDArray[np.int32]:
        return np.full(n, self.names.index(name), np.int32)

    def sample(self, name: str, position: Any, random: Any) -> Sampled:
        """Sample a light from one position or n of them with numbers (3, n)."""
        n = np.shape(random)[1]
        pad = ((0, 0), (0, -n % 16))
        where = np.pad(float32(np.broadcast_to(position, (n, 3)).T), pad, "edge")
        numbers = np.pad(float32(random), pad, "edge")
        padded = numbers.shape[1]
        vectors, scalars = (np.empty((k, padded), np.float32) for k in (6, 2))
        light = self._light(name, padded)
        run_sample_light(
            self.lights, self.surfaces, light, where, numbers, vectors, scalars
        )
        wi, radiance = vectors[:3, :n].T, vectors[3:, :n].T
        return Sampled(*(a.astype(float) for a in (wi, radiance, *scalars[:, :n])))

    def density(
        self, name: str, position: Any, prim: int, distance: Any, cosine: Any
    ) -> Array:
        """Return `pdf_area_light` [1/sr] of directions that meet a light.

        Given are the distances and |cosines| there, (n,) each.
        """
        n = len(distance)
        pad = (0, -n % 16)
        where = np.pad(float32(np.broadcast_to(position, (n, 3)).T), ((0, 0), pad), "edge")
        r, cos = (np.pad(float32(a), pad, "edge") for a in (distance, cosine))
        pdf = np.empty(n + -n % 16, np.float32)
        met = np.full(pdf.size, prim, np.int32)
        light = self._light(name, pdf.size)
        run_pdf_area_light(self.lights.areas, self.surfaces, light, met, where, r, cos, pdf)
        return pdf[:n].astype(float)

    def choices(self, number: Any) -> NDArray[np.int32]:
        """Return the light that each of 16 k numbers chooses."""
        light = np.empty(len(number), np.int32)
        run_choose_light(self.lights, float32(number), light)
        return light
