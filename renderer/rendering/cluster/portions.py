"""The missing samples of a render, divided into portions of about equal cost."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.rendering.film.film import Film

# A portion costs the client and the scheduler some milliseconds (docs/cluster.md). With
# many threads portions are longer in proportion.
MOST_SECONDS, LEAST_SECONDS = 0.5, 0.02
MOST_PER_THREAD, LEAST_PER_THREAD = 0.04, 0.01
MOST_BYTES = 1 << 22  # of the sums that are sent with a portion
_NAMED = 3  # tiles of a portion that a message names


def portion_seconds(work: float, threads: int) -> float:
    """Return the duration of the next portions [s].

    Parameters
    ----------
    work : float
        Seconds that one thread needs for all remaining work.
    threads : int
        Number of threads. Portions become shorter at the end, so that all threads end at
        about the same time. But they are not so short that the overhead dominates: n
        portions, one per thread, take n c + work / n, which is smallest for portions of
        sqrt(work c).
    """
    least = min(LEAST_PER_THREAD * threads, (LEAST_PER_THREAD * work) ** 0.5)
    most = max(MOST_SECONDS, MOST_PER_THREAD * threads)
    return min(max(work / threads / 3.0, least, LEAST_SECONDS), most)


class Portion(NamedTuple):
    """Samples begins[k] .. ends[k] - 1, counted by place places[k]."""

    places: tuple[int, ...]
    begins: tuple[int, ...]
    ends: tuple[int, ...]


class Portions:
    """The samples that the places of a film still need, for any kind of worker.

    A place is either waiting or in one portion that was taken. The sums of a portion are
    added to the film as a whole, together with the number of their samples, so the film can
    be resumed at any moment.

    Parameters
    ----------
    film : Film
        The film that gets the samples.
    wanted : int64 (places,)
        Samples that each place shall hold.
    """

    def __init__(self, film: Film, wanted: NDArray[np.int64]) -> None:
        self._film, self.wanted = film, wanted
        self._part, self._pixels = film.work.part, film.pixels_of_place
        places = np.flatnonzero(film.samples < wanted)
        self._waiting = deque(int(place) for place in places)
        self._most_places = max(1, MOST_BYTES // film.sums[0].nbytes)
        left = (wanted - film.samples)[places]
        self.missing = int(left @ self._pixels[places])  # samples that the film lacks

    @property
    def waiting(self) -> bool:
        """Whether any place is waiting."""
        return bool(self._waiting)

    def take(self, samples: float) -> Portion:
        """Return a portion of about `samples` samples, whose sums must be added later.

        Each place gets a first part before any place gets all samples. So an interrupted
        picture has no holes.
        """
        places: list[int] = []
        begins: list[int] = []
        ends: list[int] = []
        while self._waiting and len(places) < self._most_places and samples > 0:
            place = self._waiting.popleft()
            begin = int(self._film.samples[place])
            pixels = int(self._pixels[place])
            parts = 1 if begin == 0 else max(1, int(samples / pixels) // self._part)
            end = (begin // self._part + parts) * self._part
            end = min(end, int(self.wanted[place]))
            places.append(place)
            begins.append(begin)
            ends.append(end)
            samples -= (end - begin) * pixels
        return Portion(tuple(places), tuple(begins), tuple(ends))

    def fair_share(self, rate: float, threads: int) -> float:
        """Return the samples to take for a portion, if `threads` threads share the work.

        `rate` is the number of samples per second of one thread; 0: unknown.
        """
        if rate == 0.0:
            return 1.0  # the first part of one place
        return rate * portion_seconds(self.missing / rate, threads)

    def sample(self, count: int) -> Portion:
        """Return the first samples of `count` places distributed over the picture."""
        places = np.flatnonzero(self.wanted)
        chosen = places[
            np.linspace(0, len(places) - 1, min(count, len(places))).astype(int)
        ]
        ends = np.minimum(self.wanted[chosen], self._part)
        return Portion(tuple(chosen.tolist()), (0,) * len(chosen), tuple(ends.tolist()))

    def samples(self, portion: Portion) -> int:
        """Return the number of samples of a portion, over all its pixels."""
        counts = np.subtract(portion.ends, portion.begins)
        return int(counts @ self._pixels[list(portion.places)])

    def named(self, portion: Portion) -> str:
        """Return the tiles and samples of a portion, for messages."""
        film = self._film
        found = [film.tile(place % len(film.tiles)) for place in portion.places]
        corners = ", ".join(f"({tile.x}, {tile.y})" for tile in found[:_NAMED])
        more = f" and {len(found) - _NAMED} more" if len(found) > _NAMED else ""
        kind = "tile" if len(found) == 1 else "tiles"
        return (
            f"the {kind} at pixel {corners}{more}, samples {min(portion.begins)} to "
            f"{max(portion.ends) - 1}"
        )

    def sums(self, portion: Portion) -> NDArray[np.float64] | None:
        """Return the sums that a portion is added to; None: zeros."""
        if not any(portion.begins):
            return None
        sums: NDArray[np.float64] = self._film.sums[list(portion.places)]
        return sums

    def add(self, portion: Portion, sums: NDArray[np.float64]) -> None:
        """Copy the sums of a portion into the film."""
        for place, end, new in zip(portion.places, portion.ends, sums, strict=True):
            self._film.sums[place] = new
            self._film.samples[place] = end
            if end < self.wanted[place]:
                self._waiting.append(place)
        self.missing -= self.samples(portion)
