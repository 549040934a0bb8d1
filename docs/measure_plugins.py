"""Write plugins.md: how far every plugin is from Mitsuba, as measured now.

`python -m mitsuba_ref tests/plugins/*.xml --checks replay --report DIR` measures the
pictures; `python docs/measure_plugins.py DIR/results.json` measures BSDFs, phase functions
and media, by the functions of the tests (about three minutes), and writes the page.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parent.parent
TESTS = ROOT / "tests"
FOLDERS = "probes", "renderer/bsdfs", "renderer/media", "mitsuba_ref/comparison"
sys.path[:0] = map(str, (ROOT, TESTS, *(TESTS / folder for folder in FOLDERS)))

import test_bsdfs_against_mitsuba as single  # noqa: E402
import test_media_against_mitsuba as media  # noqa: E402
import test_nested_bsdfs as nested  # noqa: E402
import test_phase_functions as phases  # noqa: E402
from chi_square import chi_square  # noqa: E402

from mitsuba_ref.records.json_files import from_json  # noqa: E402
from mitsuba_ref.records.results import ReplayResult, Results  # noqa: E402
from mitsuba_ref.reference.variant import load_mitsuba  # noqa: E402

EVEN = 64  # squared: samples of an albedo
COSINES = 65  # of a phase function

HEAD = """# Every plugin compared with Mitsuba

*Written by `docs/measure_plugins.py` from the files of tests/plugins and the tables of the
tests. Measured {date} at commit {commit}: {cpu}, {cores} cores, Mitsuba {mitsuba}; others
worked on the machine, so that the seconds are rough.*

## The same random numbers

Each file shows a plugin, or a family, with all that its properties can do. Both renderers
draw the same random numbers, so that a difference is rounding or a defect. *Difference*:
the largest of a pixel, relative to its brightest channel, among pixels whose paths stayed
together; *diverged*: pixels where rounding sent a path elsewhere ({limit} of {pixels} may).
Seconds are of rendering alone, two workers each, at 16 samples; ours draws Mitsuba's
numbers, one after the other, which is slower than its own, and on so small a picture a call
costs as much as its samples: [performance.md](performance.md) measures speed.

{replays}

What no replay shows: the border of `sample_border` (both sides render with the box here,
which reaches nothing beyond its pixel), the channels of `moment` and `aov`, and the colours
of `regular`, `irregular` and `blackbody`, which Mitsuba's side gets from ours. They have
separate tests, against Mitsuba's channels, its spectral variants and laws of physics.

## Participating media

*Density*: the largest difference of a phase function from Mitsuba's own object at
{cosines} cosines, relative to the largest value. *p*: a test of Kolmogorov and Smirnov of
{turns} cosines that are drawn against the stated density; a test rejects below 1e-5.
All draw the same numbers: what inverts its integral has the same p.

{phases}

Means of 16 pictures of each renderer with random numbers of its own, of three colours
each: the ratio of ours to Mitsuba's, its standard error, and the largest difference in
standard errors (a test rejects above 5). What replays show of media is above.

{media}

## Energy

What share of the light along a direction a BSDF sends on, reflected and transmitted
(without the squeeze of radiance by the index), the mean of three colours over {samples}
even samples, seen from above at 0, 30, 60 and 85 degrees from the normal. *Apart*: the
largest difference of a colour's share from that of Mitsuba's own object, from both sides
where light goes through. *p*: chi-square tests of {draws} directions against the stated
density, seen under {seen} degrees (the second from below where light goes through); a test
rejects below 1e-5.

The first rows absorb nothing by their parameters: what lacks of 1, by more than the 0.005
that so few samples may be off, is lost by the model, as by Mitsuba's. Microfacets do not
follow light that meets a second facet, nor does a rough coat keep all that goes back and
forth below it; a smooth one does. The principled BSDF makes light, as its diffuse part
knows nothing of its mirrors.

{energy}
"""
REPLAYS = ("file", "1 spp: difference", "diverged", "16 spp: difference", "diverged")
SECONDS = ("RMSE / mean", "s ours", "s Mitsuba", "")
ENERGY = ("BSDF", "0", "30", "60", "85", "apart", "p")
PHASES = "phase function", "density", "p"
MEDIA = "scene", "red", "green", "blue", "error", "largest"


def main(source: Path) -> None:
    """Measure and write."""
    results = from_json(source.read_text(encoding="utf-8"), Results)
    first = next(scene.replay[0] for scene in results.scenes if scene.replay)
    text = HEAD.format(
        date=results.created[:10],
        commit=results.commit,
        cpu=results.machine["cpu"],
        cores=results.machine["cores"],
        mitsuba=results.versions["mitsuba"],
        limit=first.divergent_allowed,
        pixels=first.pixels,
        replays=_table((*REPLAYS, *SECONDS), replay_rows(results)),
        cosines=COSINES,
        turns=phases.DRAWN,
        phases=_table(PHASES, phase_rows()),
        media=_table(MEDIA, media_rows()),
        samples=EVEN**2,
        draws=single.SAMPLES,
        seen=" and ".join(str(degrees) for degrees in single.SEEN),
        energy=_table(ENERGY, energy_rows(single.BY_ALBEDO | single.SETS | nested.SETS)),
    )
    (ROOT / "docs" / "plugins.md").write_text(text, encoding="utf-8")


def replay_rows(results: Results) -> Iterator[str]:
    """Yield a line for each file; one that cannot be replayed says so."""
    for scene in results.scenes:
        name = f"[{scene.name}](../tests/plugins/{scene.name}.xml)"
        if not scene.replay:
            yield _row([name, *[""] * 7, "not replayed"])
            continue
        once, often = (_replay(replay) for replay in scene.replay)
        last = scene.replay[-1]
        cells = [
            name,
            *once,
            *often,
            f"{last.rmse:.1g}",
            f"{last.seconds_ours:.2g}",
            f"{last.seconds_reference:.2g}",
            scene.verdict,
        ]
        yield _row(cells)


def _replay(replay: ReplayResult) -> tuple[str, str]:
    largest = "" if replay.largest is None else f"{replay.largest:.1g}"
    return largest, str(replay.divergent)


def phase_rows() -> Iterator[str]:
    """Yield a line for each phase function of the tests."""
    mitsuba = load_mitsuba()
    cosine = np.linspace(-1.0, 1.0, COSINES)
    for name, phase in phases.PHASES.items():
        theirs = mitsuba.load_dict(phase)
        at = mitsuba.MediumInteraction3f()
        at.wi, at.sh_frame = mitsuba.Vector3f(0, 0, -1), mitsuba.Frame3f([0, 0, -1])
        at.p = mitsuba.Point3f(phases.PLACE)
        context = mitsuba.PhaseFunctionContext()
        expected = np.array(
            [
                theirs.eval_pdf(context, at, mitsuba.Vector3f((1 - c * c) ** 0.5, 0, c))[1]
                for c in cosine
            ]
        )
        mine = phases.found_for(name, np.array([cosine, cosine]), False)[1]
        apart = np.abs(mine - expected).max() / expected.max()
        yield _row([name, f"{apart:.1g}", f"{phases.drawn_as_stated(name):.2g}"])


def media_rows() -> Iterator[str]:
    """Yield a line for each scene of the tests that has media."""
    for name in media.SCENES:
        with tempfile.TemporaryDirectory() as folder:
            both = media.means(name, Path(folder))
        error, (ours, theirs) = media.standard_error(both), both.mean(axis=1)
        ratios = [f"{ratio:.4f}" for ratio in ours / theirs]
        largest = (np.abs(ours - theirs) / error).max()
        yield _row([name, *ratios, f"{(error / theirs).max():.1g}", f"{largest:.1f}"])


def energy_rows(sets: dict[str, dict[str, Any]]) -> Iterator[str]:
    """Yield a line for each set of parameters."""
    for name, bsdf in sets.items():
        ours, theirs = single.albedos(bsdf, EVEN)
        shares = [f"{share:.3f}" for share in ours[0].mean(axis=1)]
        apart = np.abs(ours - theirs).max()
        yield _row([name, *shares, f"{apart:.1g}", _chi_squares(name)])


def _chi_squares(name: str) -> str:
    """Return the p-values of a set's tests; nothing where all is mirrored or not tested."""
    if name not in single.SETS:
        return ""
    found = []
    for degrees in single.SEEN:
        counts, smooth, masses = single.counted(name, degrees)
        if not smooth:
            continue
        scale = min(smooth / single.SAMPLES / masses.sum(), 1.0)
        outcome = chi_square(counts, masses * scale, single.SAMPLES)
        found.append(f"{outcome.p_value:.2g}")
    return ", ".join(found)


def _table(head: Sequence[str], rows: Iterable[str]) -> str:
    return "\n".join((_row(head), "|" + "---|" * len(head), *rows))


def _row(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    main(Path(sys.argv[1]))
