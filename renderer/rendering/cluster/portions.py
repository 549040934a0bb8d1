"""What is still to be done of one render, dealt out in portions of about equal cost."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.rendering.film.film import Film

# To hand out a portion and take it in costs the client and the scheduler some milliseconds
# (docs/cluster.md). Where many threads are fed, portions are longer in proportion.
MOST_SECONDS, LEAST_SECONDS = 0.5, 0.02
MOST_PER_THREAD, LEAST_PER_THREAD = 0.04, 0.01
MOST_BYTES = 1 << 22  # of the sums that a portion takes along
_NAMED = 3  # tiles of a portion in a message


def portion_seconds(work: float, threads: int) -> float:
    """Return how long a portion shall take.

    Parameters
    ----------
    work : float
        Seconds that all of what is left takes one thread.
    threads : int
        That share it. Portions grow small at the end, so that all end at about the same
        time, but never so small that to deal them out takes longer than they do: n of
        them, by so many threads that each has one, take n c + work / n, whose least is at
        portions of sqrt(work c).
    """
    least = min(LEAST_PER_THREAD * threads, (LEAST_PER_THREAD * work) ** 0.5)
    most = max(MOST_SECONDS, MOST_PER_THREAD * threads)
    return min(max(work / threads / 3.0, least, LEAST_SECONDS), most)


class Portion(NamedTuple):
    """A piece of work: samples begins[k] .. ends[k] - 1 that place places[k] counts."""

    places: tuple[int, ...]
    begins: tuple[int, ...]
    ends: tuple[int, ...]


class Portions:
    """Samples that places of a film still need; nothing here depends on what adds them.

    A place waits, or is in one portion that was taken. Sums come back into the film as a
    whole, with the number of samples that they hold, so that the film is at every moment
    one to go on from.

    Parameters
    ----------
    film : Film
        Where the samples go.
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
        self.missing = int(left @ self._pixels[places])  # samples that are not in the film

    @property
    def waiting(self) -> bool:
        """Whether there is something to take."""
        return bool(self._waiting)

    def take(self, samples: float) -> Portion:
        """Return a portion of about so many samples, which is to be added in the end.

        Each place gets a first part before any gets all of its samples: an interrupted
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
        """Return how many samples to take for a worker of which `threads` are at work.

        `rate` is what one of them does in a second; 0: not known.
        """
        if rate == 0.0:
            return 1.0  # a place's first part
        return rate * portion_seconds(self.missing / rate, threads)

    def sample(self, count: int) -> Portion:
        """Return the first samples of some places that lie all over the picture."""
        places = np.flatnonzero(self.wanted)
        chosen = places[
            np.linspace(0, len(places) - 1, min(count, len(places))).astype(int)
        ]
        ends = np.minimum(self.wanted[chosen], self._part)
        return Portion(tuple(chosen.tolist()), (0,) * len(chosen), tuple(ends.tolist()))

    def samples(self, portion: Portion) -> int:
        """Return how many samples a portion is, of all its pixels."""
        counts = np.subtract(portion.ends, portion.begins)
        return int(counts @ self._pixels[list(portion.places)])

    def named(self, portion: Portion) -> str:
        """Return which tiles and samples a portion is, for messages."""
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
        """Return what a portion goes on from; None: nothing."""
        if not any(portion.begins):
            return None
        sums: NDArray[np.float64] = self._film.sums[list(portion.places)]
        return sums

    def add(self, portion: Portion, sums: NDArray[np.float64]) -> None:
        """Take a portion's sums into the film."""
        for place, end, new in zip(portion.places, portion.ends, sums, strict=True):
            self._film.sums[place] = new
            self._film.samples[place] = end
            if end < self.wanted[place]:
                self._waiting.append(place)
        self.missing -= self.samples(portion)
