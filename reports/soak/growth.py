"""Memory of one process that renders all scenes again and again.

After each round the process frees what it can and says how much memory it has. The first
half of the rounds is left out: caches fill there. Of the second half the medians of 20
blocks are tested for a trend: Kendall's S, the number of pairs in order less those in
disorder, against its values for the blocks in random orders [Mann1945]. It is growth if S
is so large in at most one of 1000 orders, *and* the last blocks have 1 MiB more than the
first. So blocks without a trend raise a false alarm in at most 0.1 % of all processes.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.statistics.hypothesis_tests.relabelling import rank_p
from reports.soak.record import Step

BLOCKS = 20
ALPHA = 1e-3
ORDERS = 10_000
LEAST = 1 << 20  # [bytes]
MIB = 1 << 20


class Trend(NamedTuple):
    """What is said of the memory of one process."""

    p: float  # of Kendall's S
    growth: float  # [bytes] from the first to the last fifth of the blocks
    medians: NDArray[np.float64]  # [bytes] of the blocks

    @property
    def grows(self) -> bool:
        """Whether that is an alarm."""
        return self.p <= ALPHA and self.growth >= LEAST


def trend(sizes: Sequence[float]) -> Trend | None:
    """Return the trend of the second half, or None: there are too few rounds."""
    later = np.asarray(sizes, np.float64)[len(sizes) // 2 :]
    if len(later) < BLOCKS:
        return None
    medians = np.array([np.median(block) for block in np.array_split(later, BLOCKS)])
    rng = np.random.default_rng(17)
    orders = np.concatenate(
        ([medians], rng.permuted(np.tile(medians, (ORDERS - 1, 1)), axis=1))
    )
    first, second = np.triu_indices(BLOCKS, 1)
    s = np.sign(orders[:, second] - orders[:, first]).sum(axis=1)
    few = BLOCKS // 5
    growth = medians[-few:].mean() - medians[:few].mean()
    return Trend(rank_p(s), float(growth), medians)


def growth_steps(done: int, deadline: float, scenes: int = 0) -> Iterator[Step]:
    """Render until the deadline in a new process, then say whether its memory grew.

    Parameters
    ----------
    done
        Pictures of processes before, which do not matter for this one.
    deadline
        Of `time.monotonic`.
    scenes
        How many of the scenes; 0 is all.
    """
    sizes: list[int] = []
    pictures = 0
    process = subprocess.Popen(
        [sys.executable, "-m", "reports.soak.rendering_process", str(scenes)],
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,  # Ctrl-C is for us
    )
    try:
        assert process.stdout is not None
        for line in process.stdout:
            rendered, size = map(int, line.split())
            sizes.append(size)
            pictures += rendered
            largest = {"MiB of memory": size / MIB, "pictures of one process": pictures}
            yield Step(rendered, {"rounds": 1}, largest)
            if time.monotonic() > deadline:
                break
        else:
            status = process.wait()
            sentence = f"the process ended with status {status} after {pictures} pictures"
            yield Step(0, {}, {}, (sentence,))
            return
    finally:
        process.kill()
        process.wait()
    yield _judged(sizes, pictures)


def _judged(sizes: Sequence[int], pictures: int) -> Step:
    found = trend(sizes)
    if found is None:
        return Step(0, {"processes with too few rounds to judge": 1})
    per_picture = found.growth / (pictures / 2 * 0.8)  # between the middles of both fifths
    sentence = (
        f"memory grew by {found.growth / MIB:.1f} MiB in the second half of {pictures} "
        f"pictures (p = {found.p:.2g}), {per_picture:.0f} bytes a picture"
    )
    return Step(
        0,
        {"processes judged": 1},
        {"bytes a picture, second half": per_picture},
        (sentence,) if found.grows else (),
        tuple(round(size / MIB, 2) for size in sizes[:: max(1, len(sizes) // 200)]),
    )
