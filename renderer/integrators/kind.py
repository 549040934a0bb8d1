"""What an integrator is: a file of this folder, and its name in `process.names`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.scene_file.description import Integrator
from renderer.scene_file.properties import Properties

NO_LIMIT = 1 << 30  # of the depth
MOST = 2**31 - 1  # of a file's integers


class Case(NamedTuple):
    """The inputs of an integrator's decision: the file's integrator, and the scene."""

    requested: Integrator
    reduce: bool  # a cheaper method with the same mean may replace it
    replay: bool  # the paths have to be Mitsuba's
    lights: bool  # the scene has any
    extended: bool  # it has some that rays can hit
    delta: bool  # it has mirrors or glass
    smooth: bool  # it has other BSDFs than these
    chooses: bool  # it has BSDFs that choose between lobes
    transparent: bool  # samples that meet only holes are black
    media: bool = False  # light is scattered or absorbed between surfaces
    straight: bool = False  # rays go straight on through surfaces

    @property
    def depth(self) -> int:
        """Maximum number of path segments; max_depth -1 is no limit."""
        return NO_LIMIT if self.requested.max_depth < 0 else self.requested.max_depth


@dataclass(frozen=True)
class Decision:
    """How paths are traced; the defaults are those of integrators of first hits."""

    method: str  # name of the integrator that runs
    max_depth: int = 1
    roulette_depth: int | None = None  # None: no Russian roulette
    no_roulette: str = ""  # the reason
    dim_depth: int | None = None  # where it begins for dim paths; None: with all paths
    survival_scale: float = 1.0  # times a path's throughput: how likely it survives
    mirrors: bool = False  # go on from mirrors and glass
    every_light: bool = False  # sample all lights at each point instead of one
    follow: bool = False  # go on from diffuse surfaces
    cutoff: float = 0.0
    light_samples: int = 1  # of `direct`, at each point
    bsdf_samples: int = 1  # of `direct`, at each point
    random: bool = False  # more is drawn than the position in the pixel


class Shown(NamedTuple):
    """The picture and the AOVs that a user gets, made from the film's channels."""

    pixels: NDArray[Any]  # (H, W, 3)
    aovs: Mapping[str, NDArray[Any]] = {}
    aov_kinds: Mapping[str, str] = {}
    notes: Mapping[str, str] = {}  # for the metadata


def as_picture(values: NDArray[Any]) -> NDArray[Any]:
    """Return an AOV (H, W, C) as colours (H, W, 3): one number as grey, two and a 0."""
    if values.shape[2] == 1:
        return np.repeat(values, 3, axis=2)
    missing = max(0, 3 - values.shape[2])
    return np.pad(values[..., :3], [(0, 0), (0, 0), (0, missing)])


@dataclass(frozen=True)
class IntegratorKind:
    """What the scene reader, the plan, the tables and the film need of an integrator."""

    about: str  # for `--explain`
    # method kernel (scene, tile, sample, work): adds what the samples of the tile's square
    # see to their slots of `work.radiance`, zero before, and writes their places on the
    # full film to `work.film`, always: the film looks for a sample's pixels there
    trace: Any
    # (case, say(topic, text)) -> Decision
    decide: Callable[[Case, Callable[[str, str], None]], Decision]
    # reads the plugin's properties; None: only `--integrator` can name it
    read: Callable[[Properties], Integrator] | None = None
    described: tuple[str, ...] = ()  # properties that `--explain` names
    channels: int = 3
    show: Callable[[NDArray[Any], Integrator], Shown] = lambda film, requested: Shown(film)
    sees_lights: bool = False  # gathers light, so that lights have tables
    scatters: bool = False  # BSDFs choose one direction
    splits: bool = False  # delta lobes are all followed, on a tree of rays
    first_hit: bool = False  # shows uv and albedo
    counts_work: bool = False
    media: bool = False  # paths go through participating media
    # `trace` for several samples of lights or BSDF at a point; None: not supported
    trace_several: Any = None
    # `trace` where panes refract light samples; None: not supported
    trace_through_panes: Any = None
    # `trace` with equiangular points in fog, where lamps are near; None: not supported
    trace_near_lamps: Any = None
