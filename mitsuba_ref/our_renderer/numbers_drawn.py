"""The random numbers of a replay for one pixel, by name; and a reset to its sample 0."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.our_renderer.traced_path import PHASE, Numbers, light_number
from renderer.kernels.records.batch import Tile
from renderer.plugins.sensors.registry import kind_of_sensor
from renderer.rendering.job import RenderJob
from renderer.replay.sequences import (
    APERTURE,
    BSDF,
    BSDF_CHOICE,
    FILM,
    LIGHT,
    ROULETTE,
    Replay,
)

_NOT_DRAWN = np.float32(2.0**-30)  # in [0, 1), and no sampler's


class NumbersDrawn:
    """What a replay of Mitsuba has drawn; our own samplers keep no numbers."""

    def __init__(self, job: RenderJob) -> None:
        self._shape = job.scene.shape
        self._has_aperture = kind_of_sensor(job.scene.description.camera).has_aperture
        record = job.sampler.record
        self._sampler = record if isinstance(record, Replay) else None
        arrays = _arrays(self._sampler.sequence) if self._sampler else []
        self._at_start = [(array, array.copy()) for array in arrays]

    def rewind(self, sample: int) -> range:
        """Go back to sample 0; return the samples to be drawn before the one wanted."""
        for array, at_start in self._at_start:
            array[...] = at_start
        return range(sample if self._sampler else 0)

    def nudge(self, tile: Tile, by: tuple[float, float], rows: slice = slice(None)) -> None:
        """Add to the numbers of a bounce, to every other one the second of the two."""
        if self._sampler is not None:
            pixel = tile.y * tile.film_width + tile.x
            column = self._sampler.numbers[rows, pixel]
            nudged = column + np.resize(np.array(by, np.float32), len(column))
            column[:] = np.clip(nudged, 0.0, np.float32(1.0 - 2.0**-24))

    def of_film(self, tile: Tile) -> Numbers:
        """Return the numbers of the positions on the film and on the lens."""
        if self._sampler is None:
            return {}
        lens = self._pair(tile, "aperture", APERTURE) if self._has_aperture else {}
        return self._pair(tile, "film", FILM) | lens

    def of_bounce(self, tile: Tile, prim: int) -> Numbers:
        """Return the numbers drawn at a hit on a primitive."""
        sampler = self._sampler
        drawn: Numbers = {}
        if sampler is None:
            return drawn
        if sampler.lights and sampler.smooth[self._shape[prim]]:
            drawn |= self._pair(tile, light_number(0), LIGHT)
        if sampler.bsdf:
            drawn["bsdf"] = self._number(tile, BSDF_CHOICE)
            drawn |= self._pair(tile, "bsdf", BSDF)
        if not sampler.direct:  # `direct` plays no roulette
            drawn["roulette"] = self._number(tile, ROULETTE)
        return drawn

    def forget(self, tile: Tile) -> None:
        """Forget the numbers of an event; paths in media draw them as they need them."""
        if self._sampler is not None:
            pixel = tile.y * tile.film_width + tile.x
            self._sampler.numbers[[BSDF_CHOICE, BSDF, LIGHT], pixel] = _NOT_DRAWN

    def of_event(self, tile: Tile, collision: bool) -> Numbers:
        """Return what was drawn since the event began, at a surface or a collision."""
        drawn: Numbers = {}
        name = PHASE if collision else "bsdf"
        if self._number(tile, LIGHT) != _NOT_DRAWN:
            drawn |= self._pair(tile, light_number(0), LIGHT)
        if self._number(tile, BSDF_CHOICE) != _NOT_DRAWN:
            drawn |= self._pair(tile, name, BSDF)
            drawn[name] = self._number(tile, BSDF_CHOICE)
        return drawn

    def _pair(self, tile: Tile, name: str, row: int) -> Numbers:
        return {
            f"{name} {axis}": self._number(tile, row + k) for k, axis in enumerate("xy")
        }

    def _number(self, tile: Tile, row: int) -> float:
        assert self._sampler is not None
        pixel = tile.y * tile.film_width + tile.x
        return float(self._sampler.numbers[row, pixel])


def _arrays(record: Any) -> list[NDArray[Any]]:
    """Return all arrays of a record of records."""
    if isinstance(record, np.ndarray):
        return [record]
    parts = record if isinstance(record, tuple) else ()
    return [array for part in parts for array in _arrays(part)]
