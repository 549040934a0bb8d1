"""The interface of an integrator; `process.names` lists the files that implement it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.scene_file.description import Integrator
from renderer.scene_file.properties import Properties

NO_LIMIT = 1 << 30  # the value of max_depth that stands for -1
MOST = 2**31 - 1  # largest integer that a scene file may hold


class Case(NamedTuple):
    """The inputs of an integrator's decision: the requested integrator and the scene."""

    requested: Integrator
    reduce: bool  # a cheaper method with the same mean is allowed
    replay: bool  # the paths must be Mitsuba's
    lights: bool  # the scene has lights
    extended: bool  # it has lights that a BSDF sample can hit
    delta: bool  # it has delta BSDFs (mirrors, glass)
    smooth: bool  # it has BSDFs with a smooth lobe
    chooses: bool  # it has BSDFs that choose between lobes
    transparent: bool  # samples that pass only through holes are black
    media: bool = False  # it has participating media
    straight: bool = False  # it has BSDFs that let rays through undeflected

    @property
    def depth(self) -> int:
        """Maximum number of path segments; max_depth -1 gives `NO_LIMIT`."""
        return NO_LIMIT if self.requested.max_depth < 0 else self.requested.max_depth


@dataclass(frozen=True)
class Decision:
    """How paths are traced. The defaults suit integrators that need the first hit only."""

    method: str  # name of the integrator that runs
    max_depth: int = 1
    roulette_depth: int | None = None  # None: no Russian roulette
    no_roulette: str = ""  # the reason, if there is no Russian roulette
    dim_depth: int | None = None  # for dim paths (`path.DIM`); None: as roulette_depth
    survival_scale: float = 1.0  # survival probability = this factor times the throughput
    mirrors: bool = False  # follow delta lobes
    every_light: bool = False  # sample all lights at each point instead of one
    follow: bool = False  # follow smooth lobes
    cutoff: float = 0.0
    light_samples: int = 1  # per point, for `direct`
    bsdf_samples: int = 1  # per point, for `direct`
    random: bool = False  # random numbers are used for more than the position in the pixel


class Shown(NamedTuple):
    """The picture and the AOVs that the user gets, computed from the film's channels."""

    pixels: NDArray[Any]  # (H, W, 3)
    aovs: Mapping[str, NDArray[Any]] = {}
    aov_kinds: Mapping[str, str] = {}
    notes: Mapping[str, str] = {}  # written to the file's metadata


def as_picture(values: NDArray[Any]) -> NDArray[Any]:
    """Return an AOV (H, W, C) as colours (H, W, 3). One channel gives grey, two get a 0."""
    if values.shape[2] == 1:
        return np.repeat(values, 3, axis=2)
    missing = max(0, 3 - values.shape[2])
    return np.pad(values[..., :3], [(0, 0), (0, 0), (0, missing)])


@dataclass(frozen=True)
class IntegratorKind:
    """What the scene reader, the planner and the film need to know of an integrator."""

    about: str  # one line, for `--explain`
    # Method kernel (scene, tile, sample, work). It adds the radiance of a square's samples
    # to their slots of `work.radiance`, which start at zero. It always writes the samples'
    # positions on the full film to `work.film`, from which the film finds their pixels.
    trace: Any
    # (case, say(topic, text)) -> Decision
    decide: Callable[[Case, Callable[[str, str], None]], Decision]
    # reads the plugin's properties; None: selected by `--integrator` only
    read: Callable[[Properties], Integrator] | None = None
    described: tuple[str, ...] = ()  # properties that `--explain` names
    channels: int = 3
    show: Callable[[NDArray[Any], Integrator], Shown] = lambda film, requested: Shown(film)
    sees_lights: bool = False  # estimates radiance, so light tables are built
    scatters: bool = False  # samples one direction per BSDF
    splits: bool = False  # follows all delta lobes, as a tree of rays
    first_hit: bool = False  # outputs uv and albedo
    counts_work: bool = False
    media: bool = False  # supports participating media
    # `trace` for several light or BSDF samples per point; None: not supported
    trace_several: Any = None
    # `trace` with light samples refracted by panes; None: not supported
    trace_through_panes: Any = None
    # `trace` with equiangular sampling near lamps in fog; None: not supported
    trace_near_lamps: Any = None
