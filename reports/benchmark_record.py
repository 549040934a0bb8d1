"""benchmark.json as records: how long each renderer took, in turn, and on what."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from reports.errors import ReportError
from reports.json_fields import JsonFields, load_json

SCHEMA = 1


@dataclass(frozen=True)
class Renderer:
    """One renderer's repeats; `unavailable` says why there are none."""

    name: str
    seconds: tuple[float, ...]  # one a round, in the order of the rounds
    unavailable: str


@dataclass(frozen=True)
class MeanCheck:
    """The image means of both renderers over some seeds, before anything is timed."""

    passed: bool
    seeds: int
    spp: int
    z: tuple[float, ...]  # per channel: difference of the means in standard errors
    limit: float
    ours_mean: tuple[float, ...]
    reference_mean: tuple[float, ...]


@dataclass(frozen=True)
class Starts:
    """Wall-clock seconds of whole `python -m renderer` processes at 1 sample per pixel."""

    warm: tuple[float, ...]
    cold: tuple[float, ...]
    command: str


@dataclass(frozen=True)
class Benchmark:
    """A whole benchmark.json."""

    created: str
    command: str
    commit: str
    machine: dict[str, str]
    versions: dict[str, str]
    scene: dict[str, str]
    width: int
    height: int
    spp: int
    workers: int
    rays_per_path: float | None
    check: MeanCheck
    renderers: tuple[Renderer, ...]  # ours first
    starts: Starts
    targets: dict[str, float]  # speed_ratio (at least), warm_seconds, cold_seconds (under)


def read_benchmark(path: Path) -> Benchmark:
    """Read and check benchmark.json.

    Raises
    ------
    ReportError
        One line: what is wrong and where.
    """
    fields = load_json(path)
    schema = fields.integer("schema")
    if schema != SCHEMA:
        raise ReportError(f"{path}: schema {schema}; this version reads schema {SCHEMA}")
    renderers = tuple(
        Renderer(one.text("name"), one.numbers("seconds"), one.text("unavailable", ""))
        for one in fields.objects("renderers")
    )
    if not renderers or not renderers[0].seconds:
        raise ReportError(f"{path}: renderers: the first one needs at least one time")
    starts, targets = fields.object("starts"), fields.object("targets")
    return Benchmark(
        created=fields.text("created", ""),
        command=fields.text("command", ""),
        commit=fields.text("commit", "unknown"),
        machine=fields.strings("machine"),
        versions=fields.strings("versions"),
        scene=fields.strings("scene"),
        width=fields.integer("width"),
        height=fields.integer("height"),
        spp=fields.integer("spp"),
        workers=fields.integer("workers"),
        rays_per_path=fields.number("rays_per_path"),
        check=_check(fields.object("check")),
        renderers=renderers,
        starts=Starts(
            starts.numbers("warm"), starts.numbers("cold"), starts.text("command", "")
        ),
        targets={key: targets.number(key) or 0.0 for key in targets.data},
    )


def _check(fields: JsonFields) -> MeanCheck:
    return MeanCheck(
        passed=bool(fields.flag("passed")),
        seeds=fields.integer("seeds"),
        spp=fields.integer("spp"),
        z=fields.numbers("z"),
        limit=fields.number("limit") or 0.0,
        ours_mean=fields.numbers("ours_mean"),
        reference_mean=fields.numbers("reference_mean"),
    )
