"""Terminal output below the verdicts: a line for each replay and each rung."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from mitsuba_ref.records.results import Parting, ReplayResult, Rung, SceneResult

REPLAY_NUMBERS = ("spp", "diverged", "may", "pixels", "RMSE of the others", "limit")
PARTING_NUMBERS = ("lightproof", "Mitsuba", "error", "limit")
RUNG_NUMBERS = ("number", "limit", "p-value", "would have seen")
EXPLAINED = "[yellow]rounding[/]"
PASSED, BROKEN = "[green]holds[/]", "[bold red]broken[/]"


def print_replays(scenes: Sequence[SceneResult], console: Console) -> None:
    """Print a line for each replay, why a scene has none, and causes that were found."""
    if any(scene.replay for scene in scenes):
        table = _table("The same random numbers on both sides", ("scene",), REPLAY_NUMBERS)
        for scene in scenes:
            _add(table, [[escape(scene.name)]], map(_replay, scene.replay))
        console.print(table)
    for scene in scenes:
        if "replay" in scene.settings:
            _line(console, scene, f"not replayed: {scene.settings['replay']}")
        _print_partings(scene, console)
        for replay in scene.replay:
            for pixel in replay.listed:
                if pixel.cause and pixel.parting is None:
                    where = f"{replay.spp} spp, pixel {pixel.x},{pixel.y}"
                    _line(console, scene, f"{where}: {pixel.cause}")


def _print_partings(scene: SceneResult, console: Console) -> None:
    """Print a line for each pixel for which the step is known in which its paths part."""
    steps: dict[tuple[int, Parting], None] = {}  # a pixel may be there for two reasons
    for replay in scene.replay:
        listed = (pixel.parting for pixel in replay.listed if pixel.parting is not None)
        steps |= dict.fromkeys((replay.spp, step) for step in (*replay.partings, *listed))
    if not steps:
        return
    table = _table(
        f"{escape(scene.name)}: the first step that differs, from the same ray",
        ("spp", "pixel", "sample", "place", "quantity"),
        PARTING_NUMBERS,
    )
    likely: dict[str, None] = {}
    for spp, step in steps:
        error = "differs" if step.error is None else _number(step.error)
        table.add_row(
            *(str(spp), f"{step.x},{step.y}", str(step.sample), step.place),
            *(step.quantity, escape(step.ours), escape(step.reference)),
            *(error, _number(step.limit)),
            "[yellow]rounding[/]" if step.within_rounding else "[bold red]defect[/]",
        )
        if not step.within_rounding:
            likely[f"{step.quantity} differs: likely {step.likely}"] = None
    console.print(table)
    for sentence in likely:
        _line(console, scene, sentence)


def print_rungs(scenes: Sequence[SceneResult], console: Console) -> None:
    """Print a line for each rung that was climbed."""
    if not any(scene.rungs for scene in scenes):
        return
    table = _table("The ladder of tests", ("scene", "rung"), RUNG_NUMBERS)
    table.caption = (
        "would have seen: with 99 % probability; docs/statistics.md says what of\n"
    )
    table.caption_justify = "left"
    for scene in scenes:
        _add(table, [[escape(scene.name)]], map(_rung, scene.rungs))
    console.print(table)
    for scene in scenes:
        for rung in scene.rungs:
            # its number is a distance; the exponent and its interval are in the sentence
            if rung.name.startswith("convergence"):
                _line(console, scene, rung.sentence)


def _table(title: str, texts: Iterable[str], numbers: Iterable[str]) -> Table:
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD)
    for column in texts:
        table.add_column(column, no_wrap=True)
    for column in numbers:
        table.add_column(column, justify="right", no_wrap=True)
    table.add_column("", no_wrap=True)
    return table


def _add(table: Table, first: list[list[str]], rows: Iterable[list[str]]) -> None:
    """Add a scene's rows; only the first has its name."""
    for row in rows:
        table.add_row(*(first.pop() if first else [""]), *row)


def _replay(replay: ReplayResult) -> list[str]:
    if not replay.pixels:  # not comparable: the reason says why
        return [str(replay.spp), "", "", "", "", "", f"[bold magenta]{replay.verdict}[/]"]
    return [
        str(replay.spp),
        str(replay.divergent),
        str(replay.divergent_allowed),
        str(replay.pixels),
        _number(replay.rmse) if replay.divergent < replay.pixels else "",
        _number(replay.rmse_limit),
        EXPLAINED if replay.passed and replay.explained else _judged(replay.passed),
    ]


def _judged(passed: bool) -> str:
    return PASSED if passed else BROKEN


def _rung(rung: Rung) -> list[str]:
    judged = _judged(rung.passed)
    if rung.passed and rung.statistic is None:
        judged = escape(rung.sentence.split(":")[0].lower())  # "not tested"
    return [
        escape(rung.name),
        _number(rung.statistic),
        _number(rung.limit),
        _number(rung.p_value),
        _seen(rung),
        judged,
    ]


def _seen(rung: Rung) -> str:
    """Return the smallest bias in its unit."""
    value = rung.detectable_bias
    if value is None or value != value or value == float("inf"):
        return ""
    if "relative" in rung.detectable:
        return f"{100.0 * value:.2g} %"
    return f"{value:.2g} px" if "pixels" in rung.detectable else f"{value:.2g}"


def _line(console: Console, scene: SceneResult, text: str) -> None:
    console.print(f"{scene.name}: {text}", markup=False, highlight=False, soft_wrap=True)


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.2g}"
