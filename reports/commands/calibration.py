"""`python -m reports.calibration`: claimed errors beside true ones, scene by scene.

Each scene is rendered to `--error` with many seeds. The true error of each picture is
measured against a picture that claims a sixth of that.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

import renderer
from mitsuba_ref.our_renderer.whole_picture import whole
from mitsuba_ref.records.machine import circumstances
from mitsuba_ref.records.proof_file import read_proof
from renderer.errors import SceneError
from renderer.rendering.accuracy import relative_error
from reports.commands.pages import DEFAULT_OUT
from reports.records.circumstances import Circumstances
from reports.records.json_file import write_json

SCHEMA = 1
SCENES = Path(__file__).parents[2] / "scenes"
NEAR = 0.2  # a claim this far from the truth at most, relative to it, is right
FINER = 6.0  # times smaller is the error of what claims are held against
REFERENCE_SEED = 4_000_000_000
MOST = 1 << 18  # samples of a reference


@dataclass(frozen=True)
class Claims:
    """The pictures of one scene."""

    scene: str
    claimed: list[float]
    true: list[float]
    spp: list[int]
    unsure: int  # pictures that say that their claim is

    @property
    def right(self) -> float:
        """The part of the claims that are within a fifth of the truth."""
        quotient = np.divide(self.claimed, self.true)
        return float(np.mean(np.abs(quotient - 1.0) <= NEAR))


@dataclass(frozen=True, kw_only=True)
class Calibration(Circumstances):
    """A whole calibration.json."""

    error: float
    scenes: list[Claims]


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, write data/calibration.json, print the table; return the exit status."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    given = _parser().parse_args(words)
    names = given.scenes or sorted(path.parent.name for path in SCENES.glob("*/scene.xml"))
    console, claims = Console(stderr=True), []
    for name in names:
        console.print(f"{name}: {given.seeds} seeds", markup=False)
        try:
            found = measure(SCENES / name / "scene.xml", given.error, given.seeds)
        except SceneError as error:
            console.print(f"  left out: {error}", markup=False, soft_wrap=True)
            continue
        if found is None:
            console.print("  left out: 16 samples have less", markup=False)
            continue
        claims.append(found)
        Console().print(_line(found), markup=False, soft_wrap=True)
    record = Calibration(
        **circumstances("reports.calibration", words),
        error=given.error,
        scenes=claims,
    )
    write_json(given.out / "data" / "calibration.json", record, SCHEMA)
    Console().print(_table(record))
    return 0


def measure(path: Path, error: float, seeds: int) -> Claims | None:
    """Render a scene to an error with many seeds; None where 16 samples have less."""
    size = read_proof(path).test
    scene = renderer.load_file(path, **({} if size is None else size.parameters))
    integrator = "path" if scene.description.integrator.name == "aov" else None
    first = renderer.render(scene, 16, integrator=integrator, target_error=1e-9)
    if first.error is None or first.error <= error:
        return None
    reference = whole(
        renderer.render(
            scene,
            MOST,
            seed=REFERENCE_SEED,
            integrator=integrator,
            target_error=error / FINER,
        )
    )
    images = [
        whole(renderer.render(scene, seed=seed, integrator=integrator, target_error=error))
        for seed in range(seeds)
    ]
    limit = np.asarray(reference, np.float64)
    return Claims(
        path.parent.name,
        [float(image.error or 0.0) for image in images],
        [relative_error(image.pixels - limit, limit) for image in images],
        [int(image.spp) for image in images],
        sum(image.error_unsure for image in images),
    )


def _line(claims: Claims) -> str:
    return f"  {claims.right:.0%} right, {claims.unsure} unsure of {len(claims.true)}"


def _table(record: Calibration) -> Table:
    table = Table(title=f"Rendered to an error of {record.error:.1%}", title_justify="left")
    for heading in ("scene", "claimed", "true: least", "most", "right", "unsure", "spp"):
        table.add_column(heading, justify="left" if heading == "scene" else "right")
    for claims in record.scenes:
        table.add_row(
            claims.scene,
            f"{np.mean(claims.claimed):.2%}",
            f"{min(claims.true):.2%}",
            f"{max(claims.true):.2%}",
            f"{claims.right:.0%}",
            str(claims.unsure),
            f"{min(claims.spp)} to {max(claims.spp)}",
        )
    return table


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m reports.calibration",
        allow_abbrev=False,
        description="Hold the errors that renders claim against their true errors.",
    )
    add = parser.add_argument
    add("scenes", nargs="*", metavar="SCENE", help="folders of scenes/ (default: all)")
    add("--error", type=float, default=0.1, help="to render to (default: 0.1)")
    add("--seeds", type=int, default=16, help="pictures of each scene (default: 16)")
    add("--out", type=Path, default=DEFAULT_OUT, help="folder (default: reports/out)")
    return parser
