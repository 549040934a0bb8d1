"""The stages that a study times are those of a render: they fill the same film."""

from __future__ import annotations

import numpy as np
import pytest

import renderer
from renderer.rendering.job import RenderJob
from renderer.rendering.planning.make_plan import make_plan
from renderer.rendering.render_options import RenderOptions
from reports.bench.study import Bench
from reports.studies.stages import STUDY, measure
from reports.trials.scene_files import scene_file
from reports.trials.stage_times import NEXT, STAGES, stage_times


@pytest.mark.parametrize("spp", [1, 16])
def test_stage_by_stage_it_is_the_same_film(spp):
    """Of one square of a tile, and of four at a time; 40 x 40 pixels are four tiles."""
    scene = renderer.load_file(scene_file("cornell-box"), width="40", height="40")
    times = stage_times(scene, spp)
    plan = make_plan(scene, spp=spp)
    job = RenderJob(scene, plan, RenderOptions(threads=1))
    film = job.make_film()
    sums = np.zeros_like(film.sums)
    for tile in range(len(film.tiles)):
        job.add_to(sums[tile], film, tile, 0, plan.spp, thread=0)
    assert sums.any()
    np.testing.assert_array_equal(times.sums, sums)
    assert set(times.seconds) == set(STAGES)
    bounces = [rays for _, rays, _ in times.by_bounce]
    assert bounces[0] == 1600 * spp
    assert bounces == sorted(bounces, reverse=True)
    assert times.rays[NEXT] == sum(bounces[1:])


def test_another_method_has_no_such_stages():
    scene = renderer.load_file(scene_file("appel-teapot"), width="8", height="8")
    with pytest.raises(ValueError, match="direct"):
        stage_times(scene, 1)


def test_its_rows_are_shares_of_the_whole(tmp_path):
    bench = Bench("stages", folder=tmp_path, options={"spp": "1"})
    rows = list(measure("cornell-box", bench))
    shares = [row.value for row in rows if row.quantity == "share of the time"]
    assert len(shares) == len(STAGES)
    assert sum(shares) == pytest.approx(100.0, abs=1.0)
    assert STUDY.cases()[:3] == ["hall", "street", "library"]
