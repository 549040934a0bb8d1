"""A request to render; both renderers get the same record."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

MIN_THREADS = 2
"""With one worker thread or none, Mitsuba waits for ever when it reads or writes an EXR
file, and a scene may hold EXR textures."""

FEWEST_SEEDS = 8
"""Of each renderer, for the ladder of tests. With fewer no relabelling reaches a p-value of
1e-3."""

TIME_LIMIT = 900.0
"""Seconds for one answer of Mitsuba, its start included."""

OF_FILE = "aov "
"""What names of rendered arrays begin with that are AOVs which the file lists."""


@dataclass(frozen=True)
class RenderRequest:
    """A scene file and how to render it; plain values, so that it travels as JSON."""

    path: str
    parameters: dict[str, str] = field(default_factory=dict)  # for the file's $name
    kind: Literal["image", "aovs"] = "image"  # "aovs": one ray through each pixel's centre
    spp: int | None = None  # None: what the file says
    seed: int = 0
    threads: int | None = None  # None: one for each core
    box_filter: bool = False  # instead of the file's filter
    independent: bool = False  # the sampler `independent` instead of the file's
    # Mitsuba's side: lamps of meshes are found by BSDF samples alone
    unsampled_lamps: bool = False
    volpath_since: str = ""  # why `volpath` stands in place of `volpathmis` there, if so
    last_lobe: bool = False  # samples of the last lobe of `hair` are in their place there
    plugins: str | None = None  # a Python file of the user's (`plugin_file`)
    allow_outside: tuple[str, ...] = ()  # folders besides the scene's (`scene_file.files`)
    replay: bool = False  # both sides draw the same random numbers
    # our side of a replay: what Mitsuba has in its camera's matrix (Reference.arrays)
    camera: tuple[float, ...] | None = None

    def with_spp(self, spp: int) -> RenderRequest:
        """Return the request with another number of samples per pixel."""
        values = {"spp": str(spp)} if "spp" in self.parameters else {}
        return replace(self, parameters=self.parameters | values, spp=spp)
