"""What the terminal shows: one row for each scene, the evidence, why a scene failed."""

from __future__ import annotations

from collections.abc import Sequence

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from mitsuba_ref.command.replay_and_rung_tables import print_replays, print_rungs
from mitsuba_ref.records.failures import failures
from mitsuba_ref.records.results import Metric, SceneResult
from mitsuba_ref.records.verdicts import Verdict

TEXTS = ("scene", "method")
JUDGED = ("spp", "RMSE", "floor", "limit", "edges")
NOT_JUDGED = ("(SSIM)", "(FLIP)", "s ours", "s Mitsuba")
FAILURE_NUMBERS = ("value", "floor", "limit")
COLOURS: dict[Verdict, str] = {"pass": "green", "fail": "bold red"}
BRACKETS = "in brackets: shown, not judged"
EDGES = "; edges: share of a picture without noise on edges, where RMSE looks away"
NOT_COMPARED = "bold magenta"


def print_table(scenes: Sequence[SceneResult], console: Console) -> None:
    """Print the table, replays and rungs, then the reasons of those that did not pass."""
    table = Table(
        title="Ours against Mitsuba scalar_rgb", title_justify="left", box=SIMPLE_HEAD
    )
    for column in TEXTS:
        table.add_column(column, overflow="fold")
    for column in (*JUDGED, *NOT_JUDGED):
        table.add_column(column, justify="right", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    for scene in scenes:
        table.add_row(*_row(scene))
    exact = any("masked_fraction" in scene.metrics for scene in scenes)
    # Rich leaves no line after a caption.
    table.caption = f"{BRACKETS}{EDGES if exact else ''}\n"
    table.caption_justify = "left"
    console.print(table)
    print_replays(scenes, console)
    print_rungs(scenes, console)
    for scene in scenes:
        for caution in scene.cautions:
            console.print(
                f"caution {escape(scene.name)}: {escape(caution)}", soft_wrap=True
            )
        for note in scene.notes:
            console.print(f"note {escape(scene.name)}: {escape(note)}", soft_wrap=True)
        if scene.verdict == "fail" and failures(scene):
            _print_failures(scene, console)
            continue
        for reason in scene.reasons:
            _print_reason(scene, reason, console)


def _print_reason(scene: SceneResult, reason: str, console: Console) -> None:
    verdict = _coloured(scene.verdict)
    console.print(f"{verdict} {escape(scene.name)}: {escape(reason)}", soft_wrap=True)


def _print_failures(scene: SceneResult, console: Console) -> None:
    """Print what is beyond its limit: each number with its floor, limit and meaning."""
    found = failures(scene)
    _print_reason(scene, "; ".join(one.quantity for one in found), console)
    table = Table(box=SIMPLE_HEAD)
    table.add_column("beyond its limit", overflow="fold", min_width=16)
    for column in FAILURE_NUMBERS:
        table.add_column(column, justify="right", no_wrap=True)
    table.add_column("what it is", overflow="fold")
    for one in found:
        numbers = (_number(n, ".3g") for n in (one.value, one.floor, one.limit))
        name = f"[bold red]{escape(one.quantity)}[/]"
        table.add_row(name, *numbers, escape(one.meaning))
    console.print(table)


def _row(scene: SceneResult) -> list[str]:
    unmeasured = Metric(None, None, None, None, "")
    rmse, masked, ssim, flip = (
        scene.metrics.get(name, unmeasured)
        for name in ("rmse", "masked_fraction", "ssim", "flip")
    )
    failed = rmse.passed is False
    return [
        escape(scene.name),
        escape(scene.integrator),
        str(scene.spp or ""),
        f"[bold red]{_number(rmse.value)}[/]" if failed else _number(rmse.value),
        _number(rmse.floor),
        _number(rmse.tolerance),
        _number(masked.value, ".0%"),
        _number(ssim.value, ".4f"),
        _number(flip.value, ".4f"),
        _number(scene.seconds.ours),
        _number(scene.seconds.reference),
        _coloured(scene.verdict) + (", see note" if scene.notes else ""),
    ]


def _coloured(verdict: Verdict) -> str:
    return f"[{COLOURS.get(verdict, NOT_COMPARED)}]{verdict}[/]"


def _number(value: float | None, form: str = ".2g") -> str:
    return "" if value is None else format(value, form)
