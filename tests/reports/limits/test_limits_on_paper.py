"""What cases of the atlas measure with, compared with what is known on paper.

That each method holds before its limit and fails behind it is asserted with all cases.
"""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from renderer.accelerators.build import build_accelerator
from renderer.kernels.records.batch import PRIMITIVES
from reports.studies.limits import structures
from reports.studies.limits.comparing import noisy, right_picture
from reports.studies.limits.lamps import (
    hidden_lamp,
    one_lamp_that_counts,
    street_of_lamps,
)
from reports.studies.limits.media import spread_behind_smoke, spread_through_colors
from reports.studies.limits.one_point import (
    by_one_strategy,
    estimates,
    scene_at,
    spread_of_a_sample,
)
from reports.studies.limits.paths import error_at_stripes, furnace_error, rays_of_a_tree
from reports.studies.limits.probes import counted, soup_mesh
from reports.trials.meshes import triangle_surfaces
from reports.trials.rays import camera_rays

STREET = np.arange(-40.0, 41.0)  # places of 81 lamps at a height of 1
GIVEN = (1.0 + STREET**2) ** -1.5
SHARE = 15 / 16 / 9 + 1 / 32  # of the samples of a lamp next to a hidden one of 8 times


@pytest.mark.parametrize(
    ("measured", "paper", "tolerance"),
    [
        # all light with probability 1 / (n + 1), n + 1 times: the root of n
        (partial(one_lamp_that_counts, 15, light_choice="uniform"), 15**0.5, 0.1),
        # the lamp that counts is one of two, next to one that would give 8 times as much
        (partial(hidden_lamp, 8.0), ((1 - SHARE) / SHARE) ** 0.5, 0.05),
        (partial(hidden_lamp, 8.0, light_choice="uniform"), 1.0, 0.05),
        (
            partial(street_of_lamps, 81, light_choice="uniform"),
            np.std(GIVEN) / np.mean(GIVEN),
            0.05,
        ),
        # what is missing of 1 / (1 - albedo) is albedo^16
        (partial(furnace_error, 5.0, depth=16, roulette=1000), 0.8**16, 0.05),
        # a Poisson number of collisions, each of which leaves 1 - share
        (partial(spread_behind_smoke, 2.0), np.expm1(2.0) ** 0.5, 0.05),
        (partial(spread_behind_smoke, 4.0, share=0.5), np.expm1(2.0) ** 0.5, 0.05),
        # paths without a real collision; each null collision multiplies red by 1.5
        (partial(spread_through_colors, 4.0), np.expm1(0.55 * 4.0) ** 0.5, 0.1),
        # the density of what comes through is the mean of three transmittances
        (
            partial(spread_through_colors, 8.0, kind="homogeneous"),
            (3 / (2 * np.exp(-0.8) + np.exp(-8)) - 1) ** 0.5,
            0.05,
        ),
    ],
    ids=[
        "starved lamp",
        "hidden lamp",
        "hidden, uniform",
        "street",
        "furnace",
        "smoke",
        "smoke, half as dense",
        "colours of a grid",
        "colours",
    ],
)
def test_as_on_paper(measured, paper, tolerance):
    assert measured() == pytest.approx(paper, rel=tolerance)


def test_a_tree_of_rays_as_on_paper():
    assert [rays_of_a_tree(d) for d in (0, 1, 2, 5)] == [1, 3, 7, 63]


def test_strata_are_judged_by_the_worst_pattern():
    """5, 6 and 7 periods alone are right: what counts is that 4 are not."""
    worst = partial(error_at_stripes, sampler="stratified", jitter=False)
    assert worst(3.0) < 1e-6 and worst(4.0) > 0.9
    assert worst(7.0) == worst(4.0)


STRATEGIES_BODY = """<shape type="rectangle"><bsdf type="roughconductor">
    <string name="material" value="none"/><float name="alpha" value="0.3"/></bsdf></shape>
<shape type="sphere"><point name="center" value="-4,0,4"/><float name="radius" value="1"/>
    <emitter type="area"/></shape>"""


def test_strategies_agree_on_the_mean():
    """Each way to find the lamp estimates the same light; they differ in noise alone.

    Means of 1024 estimates of 64 samples; four standard errors raise a false alarm in
    one of 8000 other seeds, and see a bias of 2 %.
    """
    scene = scene_at(STRATEGIES_BODY, 'origin="3,0,3" target="0,0,0" up="0,0,1"')
    usual = estimates(scene, 64)
    for strategy in ("lights", "bsdf", "both"):
        values = by_one_strategy(scene, 64, strategy)
        error = np.hypot(np.std(values), np.std(usual)) / len(values) ** 0.5
        assert abs(np.mean(values) - np.mean(usual)) < 4 * error
    assert spread_of_a_sample(usual, 64) == spread_of_a_sample(values, 64)


# --------------------------------------------------------- that a scene is the stress it is


def test_the_wall_lies_on_the_cut():
    """The middle is 0 exactly, in float32 too, and both trees cut there first."""
    mesh = soup_mesh(structures.wall(16, 0.0))
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    assert np.array_equal(low + high, np.zeros(3)) and high[0] == 1.0
    order = np.arange(mesh.triangles)
    for name in ("octree", "kd-middle"):
        tree = build_accelerator("triangles", triangle_surfaces(mesh), order, name, 3.0)
        assert tree.plane[0].tolist() == [1.0, 0.0, 0.0, 0.0]


def test_rays_start_on_planes_of_the_structures():
    """Those that the rays meet: built for the reach of the rays themselves."""
    places = structures.on_planes()
    reach = float(np.abs(places).sum(axis=1).max())
    assert len(places) > 140 and reach == structures.REACH
    surfaces = triangle_surfaces(structures.BALL)
    octree, bvh, tree = (
        build_accelerator(
            "triangles", surfaces, np.arange(structures.BALL.triangles), name, reach
        )
        for name in ("octree", "bvh", "kd-sah")
    )
    for axis in range(3):
        cuts = [t.plane[t.plane[:, axis] == 1.0, 3] for t in (octree, tree)]
        planes = np.concatenate((bvh.bounds[:, axis], *cuts))
        assert np.all(np.isin(places[:-1, axis], planes))


def test_the_teapot_is_in_one_cell_of_a_wide_stadium():
    """Each ray at it tests all its 4000 triangles, and the two of the field."""
    mesh = structures.stadium(1000.0)
    tests = counted("grid", mesh, camera_rays(mesh.view, 16, 16))[PRIMITIVES]
    assert np.all(tests >= 4000)


def test_noise_keeps_the_mean_and_has_its_deviation():
    """Over 4096 pixels: four standard errors, a false alarm in 8000 other seeds."""
    flat = np.ones((64, 64, 3))
    made = noisy(flat, 0.1, np.random.default_rng(1))
    assert np.mean(made) == pytest.approx(1.0, abs=4 * 0.1 / 64)
    assert np.std(made) == pytest.approx(0.1, rel=4 / (2 * 4096) ** 0.5)


def test_the_picture_has_what_the_defects_change():
    """Contrast in the pattern, shadow and colour: a flat picture would hide a shift."""
    picture = right_picture()
    assert picture.shape == (64, 64, 3)
    assert np.std(picture) > 0.5 * np.mean(picture)
