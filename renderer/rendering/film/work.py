"""The work of a render: which samples each sum of the film takes, and in which order.

A tile has one sum or more, its layers. A place is one tile in one layer: its sums, and how
many samples they hold, are all there is to know about it. Samples go in parts: part k of a
tile belongs to layer k % layers, and a place takes its own parts one after the other.
In one thread or in many processes, without a break or with several, the same numbers are
added in the same order: no bit of the picture depends on what adds them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# Samples of a pixel that are traced together: so many that a tile takes milliseconds.
SAMPLES_PER_JOB = 16


class Work(NamedTuple):
    """How samples are dealt out to places.

    Place p is tile p % tiles in layer p // tiles, as in `Film.sums`. It counts its samples
    for itself: its samples 0 .. n - 1 are those that it takes first.
    """

    tiles: int
    layers: int
    part: int  # samples that are traced in one go

    @property
    def places(self) -> int:
        """How many places there are."""
        return self.tiles * self.layers

    def samples(self, spp: int) -> NDArray[np.int64]:
        """Return how many of the first `spp` samples of a pixel each place takes."""
        parts, rest = divmod(spp, self.part)
        layer = np.arange(self.layers, dtype=np.int64)
        taken = (parts - layer + self.layers - 1) // self.layers * self.part
        taken[parts % self.layers] += rest
        return np.repeat(taken, self.tiles)

    def least_spp(self, samples: NDArray[np.int64]) -> int:
        """Return the smallest spp whose samples include all these of the places."""
        parts, inside = np.divmod(samples - 1, self.part)
        layer = np.arange(self.places) // self.tiles
        last = (parts * self.layers + layer) * self.part + inside
        return int(np.where(samples > 0, last + 1, 0).max())

    def pieces(self, place: int, begin: int, end: int) -> Iterator[tuple[int, int]]:
        """Give the numbers that samples begin .. end - 1 of a place have in their pixel.

        A piece (first, end) stands for samples first .. end - 1 of each pixel of the tile.
        """
        layer = place // self.tiles
        while begin < end:
            part, inside = divmod(begin, self.part)
            count = min(self.part - inside, end - begin)
            first = (part * self.layers + layer) * self.part + inside
            yield first, first + count
            begin += count
