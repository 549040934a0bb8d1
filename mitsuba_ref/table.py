"""What the terminal shows: one row for each scene, and why a scene failed."""

from __future__ import annotations

from collections.abc import Sequence

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from mitsuba_ref.results import Metric, SceneResult
from mitsuba_ref.verdicts import Verdict

TEXTS = ("scene", "method")
NUMBERS = ("spp", "RMSE", "floor", "limit", "SSIM", "FLIP", "s ours", "s Mitsuba")
COLOURS: dict[Verdict, str] = {"pass": "green", "fail": "bold red"}
NOT_COMPARED = "bold magenta"


def print_table(scenes: Sequence[SceneResult], console: Console) -> None:
    """Print the table, then the reasons of every scene that did not pass."""
    table = Table(
        title="Ours against Mitsuba scalar_rgb", title_justify="left", box=SIMPLE_HEAD
    )
    for column in TEXTS:
        table.add_column(column, overflow="fold")
    for column in NUMBERS:
        table.add_column(column, justify="right", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    for scene in scenes:
        table.add_row(*_row(scene))
    console.print(table)
    for scene in scenes:
        for reason in scene.reasons:
            console.print(
                f"{_coloured(scene.verdict)} {escape(scene.name)}: {escape(reason)}",
                soft_wrap=True,
            )


def _row(scene: SceneResult) -> list[str]:
    unmeasured = Metric(None, None, None, None, "")
    rmse, ssim, flip = (
        scene.metrics.get(name, unmeasured) for name in ("rmse", "ssim", "flip")
    )
    return [
        escape(scene.name),
        escape(scene.integrator),
        str(scene.spp or ""),
        _number(rmse.value),
        _number(rmse.floor),
        _number(rmse.tolerance),
        _number(ssim.value, ".4f"),
        _number(flip.value, ".4f"),
        _number(scene.seconds.ours),
        _number(scene.seconds.reference),
        _coloured(scene.verdict),
    ]


def _coloured(verdict: Verdict) -> str:
    return f"[{COLOURS.get(verdict, NOT_COMPARED)}]{verdict}[/]"


def _number(value: float | None, form: str = ".2g") -> str:
    return "" if value is None else format(value, form)
