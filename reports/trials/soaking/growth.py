"""Memory of one process that renders all scenes again and again.

After each round the process frees what it can and says how much memory it has. The first
half of the rounds is left out: caches fill there. Of the second half the medians of 20
blocks are tested for a trend: Kendall's S, the number of pairs in order less those in
disorder, against its values for the blocks in random orders [Mann1945]. It is growth if S
is so large in at most one of 1000 orders, *and* the last blocks have 1 MiB more than the
first. So blocks without a trend raise a false alarm in at most 0.1 % of all processes.
"""

from __future__ import annotations

import ctypes
import gc
import os
import subprocess
import sys
import time
from collections.abc import Generator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

import renderer
from mitsuba_ref.statistics.hypothesis_tests.relabelling import rank_p
from reports.bench.steps import Step
from reports.trials.soaking.sound_files import SCENES

BLOCKS = 20
ALPHA = 1e-3
ORDERS = 10_000
LEAST = 1 << 20  # [bytes]
MIB = 1 << 20


class Trend(NamedTuple):
    """What is said of the memory of one process."""

    p: float  # of Kendall's S
    growth: float  # [bytes] from the first to the last fifth of the blocks

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
    return Trend(rank_p(s), float(growth))


def growth_steps(left: int, deadline: float, scenes: int = 0) -> Generator[Step]:
    """Render in a new process, then say whether its memory grew.

    Parameters
    ----------
    left, deadline
        So many pictures, or until this time of `time.monotonic`.
    scenes
        How many of the scenes; 0 is all.
    """
    sizes: list[int] = []
    pictures = 0
    process = subprocess.Popen(
        [sys.executable, "-m", __name__, str(scenes)],
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,  # Ctrl-C is for this process alone
    )
    assert process.stdout is not None
    try:
        for line in process.stdout:
            rendered, size = map(int, line.split())
            sizes.append(size)
            pictures += rendered
            largest = {"MiB of memory": size / MIB, "pictures of one process": pictures}
            yield Step(rendered, {"rounds": 1}, largest)
            if pictures >= left or time.monotonic() > deadline:
                break
        else:
            status = process.wait()
            sentence = f"the process ended with status {status} after {pictures} pictures"
            yield Step(0, faults=(sentence,))
            return
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
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
        tuple(round(size / MIB, 2) for size in sizes[:: max(1, len(sizes) // 60)]),
    )


def main() -> None:
    """Render scenes in turn until this process is ended; a line after each round.

    The argument is how many of the scenes, 0 for all. A line says how many pictures the
    round was, and the bytes of memory after it.
    """
    paths = sorted(SCENES.glob("*/scene.xml"))
    paths = paths[: int(sys.argv[1]) or len(paths)]
    library = ctypes.CDLL(None)
    while True:
        for path in paths:
            scene = renderer.load_file(path, width=32, height=24)
            renderer.render(scene, spp=1, threads=2)
            renderer.render(scene, spp=1, seed=1, threads=1)
        gc.collect()
        if hasattr(library, "malloc_trim"):  # so that what is left is in use
            library.malloc_trim(0)
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        sys.stdout.write(f"{2 * len(paths)} {pages * os.sysconf('SC_PAGE_SIZE')}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
