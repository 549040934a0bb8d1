"""Draw docs/speed.svg and write its numbers, from the kept rows of the study.

The rows are those of `python -m reports speed-accuracy` in reports/measured. `make docs`
runs this file: it draws the chart, fills the table of docs/performance.md and the sentence
of README.md between their marks. A test compares all three with the rows.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from tempfile import gettempdir
from typing import Any

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))  # of this clone, whatever is installed

from reports.bench.rows import Run, Table  # noqa: E402
from reports.bench.store import Store  # noqa: E402
from reports.look.formatting import number  # noqa: E402
from reports.pages.speed_accuracy_page import (  # noqa: E402
    OURS,
    Efficiency,
    Scene,
    efficiencies,
    noisy_scenes,
)

PICTURE = ROOT / "docs" / "speed.svg"
README = ROOT / "README.md"
PAGE = ROOT / "docs" / "performance.md"
NAMES = {"cycles": "Cycles", "luxcore": "LuxCore"}
WIDTH, LEFT, RIGHT, ROW, TOP, BOTTOM = 760, 170, 60, 22, 18, 44


@dataclass(frozen=True)
class Bar:
    """How many times as fast ours reaches the same error in one scene."""

    scene: str
    ratio: float
    low: float  # ends of an interval of 95 %
    high: float


def kept_rows() -> Table:
    """Return the rows of the study that the repository keeps, and no others."""
    return Store(Path(gettempdir()) / "no-rows-here").read("speed-accuracy")


def bars_of(table: Table) -> list[Bar]:
    """Return a bar for each scene with noise that a peer can draw, the largest first."""
    bars = []
    for scene in noisy_scenes(table):
        row = scene.best.ratio
        if row is not None and isinstance(row.value, float):
            low, high = row.interval or (row.value, row.value)
            bars.append(Bar(scene.name, row.value, low, high))
    return sorted(bars, key=lambda bar: -bar.ratio)


def draw(bars: list[Bar]) -> str:
    """Return the chart as SVG text, the same for the same rows."""
    ends = [1.0, *(end for bar in bars for end in (bar.low, bar.high))]
    first, last = math.log(min(ends) / 1.15), math.log(max(ends) * 1.15)

    def x(value: float) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * (math.log(value) - first) / (last - first)

    below = TOP + ROW * len(bars)
    parts = [_HEAD.format(WIDTH, below + BOTTOM)]
    for tick in ticks(math.exp(first), math.exp(last)):
        kind = "one" if tick == 1.0 else "grid"
        parts.append(f'<path class="{kind}" d="M{x(tick):.1f} {TOP - 8} V{below}"/>')
        parts.append(
            f'<text class="tick" x="{x(tick):.1f}" y="{below + 15}">{tick:g}</text>'
        )
    for index, bar in enumerate(bars):
        y = TOP + ROW * index + ROW / 2
        parts += [
            f'<text class="name" x="{LEFT - 12}" y="{y + 4:g}">{bar.scene}</text>',
            f'<path class="interval" d="M{x(bar.low):.1f} {y:g} H{x(bar.high):.1f}"/>',
            f'<circle cx="{x(bar.ratio):.1f}" cy="{y:g}" r="4"/>',
            f'<text class="value" x="{x(bar.high) + 8:.1f}" y="{y + 4:g}">'
            f"{number(bar.ratio, 2)}</text>",
        ]
    middle = (LEFT + WIDTH - RIGHT) / 2
    parts.append(
        f'<text class="tick" x="{middle:g}" y="{below + 34}">'
        "times as fast as the other programs to the same error (95 % intervals)</text>"
    )
    return "\n".join([*parts, "</svg>\n"])


def ticks(least: float, most: float) -> list[float]:
    """Return the numbers 1, 2 and 5 times powers of ten between two others."""
    candidates = [step * 10.0**power for power in range(-3, 4) for step in (1.0, 2.0, 5.0)]
    return [tick for tick in candidates if least <= tick <= most]


def markdown_table(rows: list[Efficiency]) -> str:
    """Return the table of all samplers."""
    lines = ["| ours | scenes | geometric mean | 95 % | worst case | ahead in |"]
    lines.append("|---|---|---|---|---|---|")
    for row in rows:
        interval = " to ".join(map(number, row.interval))
        worst = f"{number(row.worst)} ({row.worst_scene})"
        cells = (row.name, row.scenes, number(row.mean), interval, worst, row.ahead)
        lines.append(f"| {' | '.join(map(str, cells))} |")
    return "\n".join(lines)


def other_programs(scenes: list[Scene]) -> str:
    """Return the programs that the rows compare with, in words."""
    found = {one.program for scene in scenes for one in scene.curves} - {OURS}
    variants = sorted(name.split()[1] for name in found if name.startswith("mitsuba"))
    names = [f"Mitsuba's {' and '.join(f'`{one}`' for one in reversed(variants))}"]
    names += [NAMES[name] for name in sorted(found) if name in NAMES]
    return " and ".join([", ".join(names[:-1]), names[-1]] if names[1:] else names)


def circumstances(table: Table) -> str:
    """Return where and when the rows were measured, and how large the pictures are."""
    sizes = [str(row.value).split(" x ") for row in table.where(quantity="size")]
    longer = [max(map(int, size)) for size in sizes]
    runs, scenes = table.measured, noisy_scenes(table)
    commits = _ends(run.commit[:7] for run in runs)
    samples = {one.errors[-1].at for scene in scenes for one in scene.ours}
    seeds = {row.value for row in table.where(quantity="seeds")}
    return (
        f"The other programs are {other_programs(scenes)}. Measured with {_span(seeds)} "
        f"seeds at {_span(samples)} samples per pixel on {machine_of(runs[-1])}, by "
        f"commits {commits}, {dates(table)}: each scene by the last that measured it. "
        f"The longer side of a picture has {_span(longer)} pixels."
    )


def _span(numbers: Iterable[Any]) -> str:
    """Return a number, or the least and the largest."""
    found = sorted({int(number) for number in numbers if number is not None})
    return f"{found[0]}" if len(found) == 1 else f"{found[0]} to {found[-1]}"


def _ends(parts: Iterable[str]) -> str:
    """Return the first and the last, or the one that there is."""
    found = list(dict.fromkeys(parts))
    return " to ".join(dict.fromkeys((found[0], found[-1])))


def dates(table: Table) -> str:
    """Return the first and the last day on which the rows were measured."""
    return _ends(run.created[:10] for run in table.measured)


def machine_of(run: Run) -> str:
    """Return the processor in words."""
    name = str(run.machine.get("cpu", "an unknown processor")).replace("(R)", "")
    return f"{run.machine.get('cores')} cores ({name})"


def sentence(best: Efficiency, table: Table, others: str) -> str:
    """Return what the README says about the speed."""
    low, high = map(number, best.interval)
    return (
        f"Over {best.scenes} scenes lightproof is {number(best.mean)} times as fast to the "
        f"same error as the fastest of\n{others} (geometric mean; "
        f"95 % interval {low} to {high}).\nThe worst scene is "
        f"`{best.worst_scene}` with {number(best.worst)}. Measured on "
        f"{machine_of(table.measured[-1])}, {dates(table)}."
    )


def filled(text: str, name: str, content: str) -> str:
    """Return a document with new content between its marks `<!-- name -->`.

    Raises
    ------
    ValueError
        If it has no such marks.
    """
    marks = re.compile(rf"(<!-- {name} -->\n).*?(<!-- end of {name} -->)", re.DOTALL)
    if not marks.search(text):
        raise ValueError(f"no marks <!-- {name} --> in the document")
    return marks.sub(lambda found: f"{found[1]}\n{content}\n\n{found[2]}", text)


def documents(table: Table) -> dict[Path, str]:
    """Return what the chart, the page and the README are with these rows."""
    scenes = noisy_scenes(table)
    rows, others = efficiencies(scenes), other_programs(scenes)
    readme, page = (path.read_text(encoding="utf-8") for path in (README, PAGE))
    shown = f"{markdown_table(rows)}\n\n{circumstances(table)}"
    return {
        PICTURE: draw(bars_of(table)),
        PAGE: filled(page, "speed-accuracy table", shown),
        README: filled(readme, "speed", sentence(rows[0], table, others)),
    }


_HEAD = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {0} {1}" \
font-family="sans-serif" font-size="13">
<title>How many times as fast as other programs lightproof reaches the same error</title>
<style>.name {{ text-anchor: end }} .tick {{ text-anchor: middle; fill: #555 }}
.value {{ fill: #555 }} circle {{ fill: #1f6fb2 }}
path {{ fill: none }} .interval {{ stroke: #1f6fb2; stroke-width: 2 }}
.grid {{ stroke: #e2e6ea }} .one {{ stroke: #777; stroke-dasharray: 4 3 }}
</style>
<rect width="100%" height="100%" fill="#fff"/>"""


if __name__ == "__main__":
    for path, text in documents(kept_rows()).items():
        path.write_text(text, encoding="utf-8")
