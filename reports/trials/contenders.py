"""Renderers that are compared: ours in this process, a variant of Mitsuba in its own.

A contender is a function of (seed, samples per pixel) that renders a scene which is loaded
already. Speed of a wrong picture is worth nothing, so `compare_means` comes before timing.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import renderer
from mitsuba_ref.ladder.pictures_by_seed import SEED_STEP
from mitsuba_ref.our_renderer.whole_picture import whole
from mitsuba_ref.reference.errors import MitsubaError
from mitsuba_ref.speed.timed_mitsuba import TimedMitsuba
from mitsuba_ref.statistics.hypothesis_tests.welch import critical_t, sidak_p, welch
from renderer.scene.scene import Scene

OURS = "lightproof"
REFERENCE = "mitsuba scalar_rgb"  # its pictures are the truth
PEERS = {REFERENCE: "scalar_rgb", "mitsuba llvm_ad_rgb": "llvm_ad_rgb"}

# Of one comparison, all three channels together. The study of speed against accuracy makes
# some 350: one right contender is stopped in a hundred runs. Five standard errors, whatever
# the degrees of freedom, would be 0.2 % of a comparison where the judge alone is noisy
# (8 seeds, 7 degrees), and one in two runs.
ALPHA = 3e-5

# Two float32 renders of the same noiseless scene differ by rounding alone.
ROUNDING = 1e-5

Rgb = tuple[float, float, float]
Picture = NDArray[np.float64]  # (height, width, 3), linear sRGB
Shot = tuple[float, Picture]  # seconds, and what was rendered


@dataclass(frozen=True, eq=False)
class Render:
    """One render."""

    seconds: float
    mean: Rgb  # of all pixels, linear sRGB


Contender = Callable[[int, int], Render]
"""Renders with (seed, samples per pixel), warm."""


def of_ours(scene: Scene, threads: int, **ways: Any) -> Callable[[int, int], Shot]:
    """Return our renderer, by (seed, samples per pixel).

    Parameters
    ----------
    scene
        Loaded.
    threads
        Threads.
    **ways
        Further arguments of `renderer.render`, such as `sampler` or `integrator`.

    Returns
    -------
    function
        Raises KeyboardInterrupt instead of returning a part of the samples.
    """

    def render(seed: int, spp: int) -> Shot:
        begin = time.perf_counter()
        picture = np.asarray(whole(renderer.render(scene, spp, seed, threads, **ways)))
        return time.perf_counter() - begin, picture[..., :3].astype(np.float64)

    return render


def mean_of(renders: Callable[[int, int], Shot]) -> Contender:
    """Return a renderer of which the means of pictures are compared."""

    def render(seed: int, spp: int) -> Render:
        seconds, picture = renders(seed, spp)
        return Render(seconds, _rgb(picture.mean(axis=(0, 1))))

    return render


def mitsuba(peer: TimedMitsuba, sampler: str | None = None) -> Contender:
    """Return a variant of Mitsuba; of its pictures only their means come back.

    Pictures of its neighbouring seeds share random numbers (docs/statistics.md); the seeds
    that it gets are `SEED_STEP` apart.

    Parameters
    ----------
    peer
        A process with the scene loaded.
    sampler
        One that it was loaded with; None: the file's.
    """

    def render(seed: int, spp: int) -> Render:
        timed = peer.render(SEED_STEP * seed, spp, None, sampler)
        return Render(timed.seconds, timed.mean)

    return render


def load_all(
    stack: ExitStack,
    path: Path,
    parameters: dict[str, str],
    threads: int,
    show: Callable[[str], None],
    sampler: str | None = None,
    **ways: Any,
) -> tuple[dict[str, Contender], dict[str, str]]:
    """Load a scene in our renderer and in all `PEERS`; only their means come back.

    Parameters
    ----------
    stack
        Ends the processes of the peers.
    path, parameters
        Scene file, and values for its `$name`.
    threads
        Of each renderer, at least 2.
    show
        Called with what is being loaded.
    sampler
        Of all of them, instead of the file's.
    **ways
        Further arguments of our `render`.

    Returns
    -------
    contenders, absent
        By name, ours first; why a peer is not among them.

    Raises
    ------
    MitsubaError
        If `REFERENCE` cannot render the scene.
    """
    show(f"loading {OURS}")
    scene = renderer.load_file(path, **parameters)
    contenders = {OURS: mean_of(of_ours(scene, threads, sampler=sampler, **ways))}
    absent: dict[str, str] = {}
    for name, variant in PEERS.items():
        show(f"loading {name}")
        samplers = [sampler] if sampler else []
        try:
            peer = TimedMitsuba(variant, path, parameters, threads, samplers)
        except MitsubaError as error:
            if name == REFERENCE:
                raise
            absent[name] = str(error)
        else:
            contenders[name] = mitsuba(stack.enter_context(peer), sampler)
    return contenders, absent


@dataclass(frozen=True)
class MeansCompared:
    """Image means of two contenders over several seeds."""

    z: Rgb  # difference in standard errors
    limit: float  # of |z|, by Welch's test: it hangs on whose noise it is
    p: float  # of the three channels together
    first: Rgb
    second: Rgb

    @property
    def passed(self) -> bool:
        """Whether right contenders differ as much more often than `ALPHA`."""
        return self.p >= ALPHA and bool(np.isfinite((self.first, self.second)).all())

    def sentence(self, first: str, second: str) -> str:
        """Say how far apart the means of two contenders of these names are."""
        one, other, z = (
            ", ".join(f"{value:.4g}" for value in values)
            for values in (self.first, self.second, self.z)
        )
        return (
            f"image means of {first} ({one}) and of {second} ({other}) are {z} standard "
            f"errors apart (limit {self.limit:.2g})"
        )


def compare_means(
    first: Contender, second: Contender, seeds: Sequence[int], spp: int
) -> MeansCompared:
    """Render with both over all seeds and compare the image means.

    The standard error comes from the spread over seeds, never over pixels: a
    reconstruction filter makes neighbouring pixels depend on one another.

    Parameters
    ----------
    first, second
        Contenders; they get different seeds, so that no random numbers are shared.
    seeds
        At least two.
    spp
        Samples per pixel of each render.
    """
    offset = max(seeds) + 1
    one = np.array([first(seed, spp).mean for seed in seeds])
    two = np.array([second(seed + offset, spp).mean for seed in seeds])
    result = welch(one, two, ROUNDING)
    return MeansCompared(
        _rgb(result.t),
        critical_t(ALPHA, result.p.size, float(np.min(result.degrees))),
        sidak_p(float(np.min(result.p)), result.p.size),
        _rgb(one.mean(axis=0)),
        _rgb(two.mean(axis=0)),
    )


def _rgb(values: NDArray[Any]) -> Rgb:
    red, green, blue = (float(value) for value in values)
    return red, green, blue
