"""What samples by tile would gain: more of them where the variance is, in two stages.

Each scene is rendered evenly, and then as a renderer that divides its samples would: a
pilot of the whole picture, whose two halves say how large the variance of each tile is, and
then each tile as a crop window with samples by sqrt(variance / cost of a sample), which is
best for a sum of variance / samples at a given sum of cost x samples. The second stage's
number depends on the pilot and not on its own samples, so it is without bias by itself, and
so is its mean with the pilot at weights fixed before (1/4 and 3/4). Processor time, one
thread.
"""

from __future__ import annotations

import dataclasses
import functools
import statistics
import time
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

import renderer
from mitsuba_ref.records.proof_file import read_proof
from renderer.errors import SceneError
from renderer.rendering.accuracy import relative_error, relative_squares
from renderer.rendering.job import RenderJob
from renderer.rendering.planning.make_plan import make_plan
from renderer.rendering.render_loop import run
from renderer.rendering.render_options import RenderOptions
from renderer.scene.scene import Scene
from reports.bench.rows import Row, Table
from reports.bench.study import Bench, described
from reports.look.formatting import number
from reports.trials.scene_files import scene_content, scene_file, scene_names

EVEN, PILOT = 64, 16  # samples per pixel of a whole picture, and of its first stage
SPREAD = 0.2  # of the second stage, evenly: a pilot may have met nothing somewhere
REFERENCE = 512
NOISY = 0.05  # error of the pilot, below which a scene is left out
FAR = 4_000_000_000  # seeds from here on are not those of the pictures

GAIN = "gain in 1 / (relative MSE x time)"
WAYS = {
    "best": "best, if variance and cost were known",
    "thrown": "second stage alone",
    "kept": "both stages, fixed weights",
    "pooled": "both stages, by samples",
}

Floats = NDArray[np.float64]
Window = tuple[slice, slice]


def windows_of(height: int, width: int, side: int) -> list[Window]:
    """Return the tiles of a picture, as rows and columns."""
    return [
        (slice(y, min(y + side, height)), slice(x, min(x + side, width)))
        for y in range(0, height, side)
        for x in range(0, width, side)
    ]


def cropped(scene: Scene, window: Window) -> Scene:
    """Return a scene whose film is one tile of it; the accelerators are shared."""
    rows, columns = window
    film = dataclasses.replace(
        scene.description.camera.film,
        crop_offset_x=columns.start,
        crop_offset_y=rows.start,
        crop_width=columns.stop - columns.start,
        crop_height=rows.stop - rows.start,
    )
    camera = dataclasses.replace(scene.description.camera, film=film)
    tile = dataclasses.replace(
        scene, description=dataclasses.replace(scene.description, camera=camera)
    )
    vars(tile)["_built"] = scene._built
    return tile


def traced(scene: Scene, spp: int, seed: int) -> tuple[Floats, float]:
    """Return a picture and the processor time of its samples [s]."""
    plan = make_plan(scene, sampler="independent", spp=spp)
    job = RenderJob(scene, plan, RenderOptions(seed=seed, threads=1))
    job.compile()
    film = job.make_film()
    start = time.process_time()
    run(job, film)
    seconds = time.process_time() - start
    return film.develop(1).astype(np.float64), seconds


def by_tile(squares: Floats, windows: list[Window]) -> Floats:
    """Return the sums of the tiles."""
    return np.array([squares[window].sum() for window in windows])


def second_stage(variance: Floats, cost: Floats, spp: int) -> NDArray[np.int64]:
    """Return the samples of each tile that cost what `spp` of every tile would."""
    wanted = np.sqrt(variance / cost)
    share = wanted * cost.sum() / max(float(np.sum(wanted * cost)), 1e-300)
    return np.maximum(1, np.rint(spp * (SPREAD + (1.0 - SPREAD) * share))).astype(np.int64)


def gain_at_best(variance: Floats, cost: Floats) -> float:
    """Return by how much error x time falls if both are known beforehand."""
    even = variance.sum() * cost.sum()
    return float(even / np.sum(np.sqrt(variance * cost)) ** 2)


def trial(scene: Scene, side: int, seeds: int) -> dict[str, float] | None:
    """Return the gains in 1 / (relMSE x time) over even samples; None: hardly any noise."""
    first = renderer.render(scene, PILOT, FAR, target_error=1e-9)
    if first.error is None or first.error < NOISY:
        return None
    reference = renderer.render(scene, REFERENCE, FAR + 1, target_error=1e-9)
    limit, own = np.asarray(reference.pixels, np.float64), float(reference.error or 0.0)
    windows = windows_of(limit.shape[0], limit.shape[1], side)
    tiles = [cropped(scene, window) for window in windows]

    def error(picture: Floats) -> float:
        return relative_error(picture - limit, limit) ** 2 - own**2

    found: dict[str, list[float]] = {"even": [], "thrown": [], "kept": [], "pooled": []}
    spent: dict[str, list[float]] = {"even": [], "stages": []}
    pictures = []
    for seed in range(seeds):
        even = np.zeros_like(limit)
        cost = np.zeros(len(windows))
        for k, window in enumerate(windows):
            even[window], seconds = traced(tiles[k], EVEN, seed)
            cost[k] = seconds / EVEN
        pictures.append(even)
        image = renderer.render(scene, PILOT, FAR + 2 + seed, target_error=1e-9)
        pilot, guess = np.asarray(image.pixels, np.float64), image.error_of_pixels
        squares = relative_squares(guess, pilot)
        counts = second_stage(by_tile(squares, windows), cost, EVEN - PILOT)
        stage, seconds_in_all = np.zeros_like(limit), 0.0
        pooled = np.zeros_like(limit)
        for k, window in enumerate(windows):
            stage[window], seconds = traced(tiles[k], int(counts[k]), seed + seeds)
            seconds_in_all += seconds
            share = PILOT / (PILOT + counts[k])
            pooled[window] = share * pilot[window] + (1.0 - share) * stage[window]
        fixed = PILOT / EVEN
        found["even"].append(error(even))
        found["thrown"].append(error(stage))
        found["kept"].append(error(fixed * pilot + (1.0 - fixed) * stage))
        found["pooled"].append(error(pooled))
        spent["even"].append(float(cost.sum()) * EVEN)
        spent["stages"].append(seconds_in_all + float(cost.sum()) * PILOT)
    mse = {name: float(np.mean(values)) for name, values in found.items()}
    slower = float(np.sum(spent["stages"]) / np.sum(spent["even"]))
    variance = relative_squares(np.std(pictures, axis=0, ddof=1), limit)
    most = np.partition(variance, -1 - variance.size // 1000, axis=None)
    variance = np.minimum(variance, most[-1 - variance.size // 1000])
    gains = {n: mse["even"] / (mse[n] * slower) for n in ("thrown", "kept", "pooled")}
    return {
        "pilot": float(first.error),
        "tiles": float(len(windows)),
        "best": gain_at_best(by_tile(variance, windows), cost),
        **gains,
    }


def measure(case: str, bench: Bench) -> Iterator[Row]:
    """Yield what dividing the samples of a scene would gain, several ways."""
    path = scene_file(case)
    size = read_proof(path).demo
    scene = renderer.load_file(path, **({} if size is None else size.parameters))
    gains, why = None, f"{PILOT} samples have an error below {100.0 * NOISY:g} %"
    try:
        gains = trial(scene, bench.whole("side", 16), bench.whole("seeds", 2, 2))
    except SceneError as error:  # no colours, so no error either
        why = str(error)
    row = functools.partial(Row, case=case)
    if gains is None:
        yield row(quantity="left out", value=why)
        return
    for way, title in WAYS.items():
        yield row(contender=title, quantity=GAIN, value=gains[way], unit="times")
    yield row(quantity="error of the pilot", value=100.0 * gains["pilot"], unit="%")
    yield row(quantity="tiles", value=gains["tiles"])


def verdict(table: Table) -> str:
    """Say what each way gains, as geometric means over the scenes."""
    parts = []
    for way in WAYS.values():
        rows = table.where(quantity=GAIN, contender=way)
        gains = [row.value for row in rows if isinstance(row.value, float)]
        if gains:
            parts.append(f"{way}: {number(statistics.geometric_mean(gains))} times")
    return "Gain: " + "; ".join(parts) + "." if parts else ""


STUDY = described(
    "samples-by-tile",
    cases=scene_names,
    inputs=lambda case, options: scene_content(case),
    quick_cases=("cornell-box", "caustic"),
    measure=measure,
    verdict=verdict,
)
