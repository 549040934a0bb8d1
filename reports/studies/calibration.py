"""Claimed errors against true ones.

Each scene is rendered to an error with many seeds. The true error of each picture is
measured against a picture that claims a sixth of that.
"""

from __future__ import annotations

import functools
import statistics
from collections.abc import Iterator, Sequence

import numpy as np
from scipy import stats

import renderer
from mitsuba_ref.our_renderer.whole_picture import whole
from mitsuba_ref.records.proof_file import read_proof
from renderer.errors import SceneError
from renderer.rendering.accuracy import relative_error
from reports.bench.rows import Row, Table
from reports.bench.study import Bench, described
from reports.bench.timing import LEVEL
from reports.look.formatting import number
from reports.trials.scene_files import scene_content, scene_file, scene_names

NEAR = 0.2  # a claim this far from the truth at most, relative to it, is right
FINER = 6.0  # times smaller is the error of what claims are compared with
REFERENCE_SEED = 4_000_000_000
MOST = 1 << 18  # samples of a reference

ERROR, RIGHT = "error of a picture", "claims within a fifth of the truth"
CLAIMED, TRUE = "claimed", "true"


def measure(case: str, bench: Bench) -> Iterator[Row]:
    """Render a scene to an error with many seeds; yield claims and truth."""
    error = bench.whole("error", 10) / 100.0
    seeds = bench.whole("seeds", 4 if bench.quick else 16, 2)
    path = scene_file(case)
    size = read_proof(path).test
    scene = renderer.load_file(path, **({} if size is None else size.parameters))
    integrator = "path" if scene.description.integrator.name == "aov" else None
    render = functools.partial(renderer.render, scene, integrator=integrator)
    why = f"16 samples have an error below {100.0 * error:g} %"
    try:
        first = render(spp=16, target_error=1e-9).error
    except SceneError as refused:  # no colours, so no error either
        first, why = None, str(refused)
    if first is None or first <= error:
        yield Row(case=case, quantity="left out", value=why)
        return
    bench.show("the reference")
    finer = error / FINER
    reference = whole(render(spp=MOST, seed=REFERENCE_SEED, target_error=finer))
    limit = np.asarray(reference, np.float64)
    images = []
    for seed in range(seeds):
        bench.show(f"seed {seed + 1} of {seeds}")
        images.append(whole(render(seed=seed, target_error=error)))
    yield from claims(
        case,
        [float(image.error or 0.0) for image in images],
        [relative_error(image.pixels - limit, limit) for image in images],
        [int(image.spp) for image in images],
        sum(image.error_unsure for image in images),
    )


def claims(
    case: str,
    claimed: Sequence[float],
    true: Sequence[float],
    spp: Sequence[int],
    unsure: int,
) -> Iterator[Row]:
    """Yield the rows of one scene.

    Parameters
    ----------
    case
        Name of the scene.
    claimed, true, spp
        Of each picture: errors relative to 1, samples per pixel.
    unsure
        How many pictures say that their claim is unsure.
    """
    row = functools.partial(Row, case=case)
    for name, errors in ((CLAIMED, claimed), (TRUE, true)):
        percent = 100.0 * np.array(errors)
        mean, student = float(percent.mean()), stats.t.ppf(0.5 + LEVEL / 2.0, len(true) - 1)
        half = float(student * stats.sem(percent))
        yield row(
            contender=name,
            quantity=ERROR,
            unit="%",
            value=mean,
            interval=(mean - half, mean + half),
        )
    quotients = np.divide(claimed, true)
    right = int(np.sum(np.abs(quotients - 1.0) <= NEAR))
    low, high = stats.binomtest(right, len(true)).proportion_ci(LEVEL)
    yield row(
        quantity=RIGHT,
        unit="%",
        value=100.0 * right / len(true),
        interval=(100.0 * low, 100.0 * high),
    )
    unsure_of = f"{unsure} of {len(true)}"
    yield row(quantity="pictures that call their claim unsure", value=unsure_of)
    for name, least in (("least", min), ("most", max)):
        end = functools.partial(row, contender=name)
        yield end(quantity="true errors", unit="%", value=100.0 * least(true))
        yield end(quantity="samples per pixel", value=float(least(spp)))


def verdict(table: Table) -> str:
    """Say how many of all claims are right, and in which scene the fewest are."""
    right = {
        row.case: row.value
        for row in table.where(quantity=RIGHT)
        if isinstance(row.value, float)
    }
    if not right:
        return ""
    mean, worst = statistics.fmean(right.values()), min(right, key=lambda c: right[c])
    if right[worst] == 100.0:
        return f"All claims of {len(right)} scenes are within a fifth of the true error."
    return (
        f"{number(mean)} % of the claimed errors of {len(right)} scenes are within a fifth "
        f"of the true error; the fewest, {number(right[worst])} %, in {worst}."
    )


STUDY = described(
    "calibration",
    cases=scene_names,
    inputs=lambda case, options: scene_content(case),
    quick_cases=("cornell-box", "metals"),
    measure=measure,
    verdict=verdict,
)
