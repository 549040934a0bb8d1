"""Moving scenes: the study holds what it says, and the page shows what it holds."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from drawn_charts import curves, figure, figures, guides, points

from reports.accelerator_trials.meshes import displaced_icosphere
from reports.charts.curves import progress_chart
from reports.charts.figure import Point, Series
from reports.moving_scene import study as moving_scene
from reports.moving_scene.motions import MOTIONS
from reports.moving_scene.section import moving_scene_section, rays_to_win_back
from reports.moving_scene.study import main, study_moving_scene


@pytest.fixture(scope="module")
def study():
    return study_moving_scene(frequency=7, frames=3, rays=512, turns=1)


def at_rest():
    mesh = displaced_icosphere(4)
    return mesh.vertices[mesh.faces].astype(np.float64)


@pytest.mark.parametrize("motion", MOTIONS, ids=lambda motion: motion.name)
def test_motions_begin_at_rest(motion):
    """The tree at rest is the one that is refitted; and then something must move."""
    corners = at_rest()
    np.testing.assert_allclose(motion.move(corners, 0.0), corners, atol=1e-15)
    assert np.abs(motion.move(corners, 0.3) - corners).max() > 0.1


def test_mixing_ends_with_all_places_taken():
    corners = at_rest()
    there = MOTIONS[-1].move(corners, 1.0).mean(axis=1)
    places = corners.mean(axis=1)
    np.testing.assert_allclose(
        sorted(map(tuple, there.round(9))), sorted(map(tuple, places.round(9)))
    )
    assert np.median(np.linalg.norm(there - places, axis=1)) > 1.0


def test_the_study_is_plain_data(study):
    """JSON holds it, and every time and count is a number above 0."""
    assert json.loads(json.dumps(study)) == study
    assert study["triangles"] == 20 * 7**2
    assert [motion["name"] for motion in study["motions"]] == ["wave", "twist", "mixing"]
    for motion in study["motions"]:
        assert [frame["progress"] for frame in motion["frames"]] == [0.0, 0.5, 1.0]
        for frame in motion["frames"]:
            numbers = [frame[f"{way}_ms"] for way in ("rebuild", "refit")]
            for tree in ("rebuilt", "refitted"):
                assert frame[tree].keys() == {"ns_per_ray", "sah_cost", "nodes"}
                numbers += frame[tree].values()
            assert all(number > 0 for number in numbers)


def test_where_refitting_loses(study):
    """Counts, not times: alike at rest, many times more when neighbours have parted.

    A wave ends where it began, so its last frame is as good as the first.
    """
    wave, _, mixing = (motion["frames"] for motion in study["motions"])
    for frame in (wave[0], wave[2], mixing[0]):
        for key in ("sah_cost", "nodes"):
            assert frame["refitted"][key] == pytest.approx(frame["rebuilt"][key], rel=0.02)
    for key in ("sah_cost", "nodes"):
        assert mixing[2]["refitted"][key] > 5 * mixing[2]["rebuilt"][key]


def test_other_hits_stop_the_study(monkeypatch):
    """No time is taken of a tree that gives other hits."""

    def shrunk(*arguments):
        tree = moving_scene.build_bvh(*arguments[1:])
        return tree._replace(bounds=tree.bounds * np.float32(0.5))

    monkeypatch.setattr(moving_scene, "refit_bvh", shrunk)
    with pytest.raises(AssertionError, match="other hits"):
        study_moving_scene(frequency=4, frames=2, rays=256, turns=1)


def frame(rebuild_ms, refit_ms, rebuilt, refitted):
    return {
        "progress": 1.0,
        "rebuild_ms": rebuild_ms,
        "refit_ms": refit_ms,
        "rebuilt": {"ns_per_ray": rebuilt, "sah_cost": 30.0, "nodes": 20.0},
        "refitted": {"ns_per_ray": refitted, "sah_cost": 60.0, "nodes": 50.0},
    }


@pytest.mark.parametrize(
    ("times", "expected"),
    [
        ((51.0, 1.0, 1000.0, 1500.0), 100_000.0),  # 50 ms at 500 ns a ray
        ((51.0, 1.0, 1000.0, 1000.0), None),
        ((51.0, 1.0, 1000.0, 900.0), None),
        ((1.0, 2.0, 1000.0, 1500.0), 0.0),
    ],
)
def test_rays_that_win_back_a_rebuild(times, expected):
    assert rays_to_win_back(frame(*times)) == expected


def test_the_section_shows_what_was_measured():
    """Numbers of one frame, read back from the HTML; names are escaped."""
    moving = {
        "triangles": 65536,
        "rays": 4096,
        "turns": 3,
        "cores": 2,
        "motions": [
            {
                "name": "<twist>",
                "about": "a & b",
                "frames": [
                    frame(51, 1, 1000, 1000) | {"progress": 0.0},
                    frame(51, 1, 1000, 1500),
                ],
            }
        ],
    }
    section = str(moving_scene_section(moving))
    tree = ET.fromstring(f"<section>{section}</section>")  # well-formed, so all is closed
    rows = [[cell.text for cell in row] for row in tree.iter("tr")][2:]
    frames = ["<twist>", "100 %", "51 ms", "1 ms", "1000", "1500", "30", "60", "20", "50"]
    assert rows == [[*frames, "100,000 rays"]]
    assert "65,536 triangles, 4,096 incoherent rays" in section
    assert len(figures(section)) == 2


def test_the_section_of_a_real_study(study):
    """Three motions, of three frames each the second and the last in the table."""
    section = moving_scene_section(study)
    tree = ET.fromstring(f"<section>{section}</section>")
    assert len(list(tree.iter("tr"))) == 2 + 3 * 2
    assert [len(curves(one)) for one in figures(section)] == [3, 3]


def test_the_chart_has_ratios_and_a_guide_where_both_cost_the_same():
    """Ratios over per cent on a logarithmic axis; the guide is level at 1."""
    places = ((0.0, 1.0), (50.0, 10.0), (100.0, 100.0))
    series = Series("a", tuple(Point(x, y) for x, y in places))
    chart = figure(progress_chart([series], y_label="y", description="d"))
    assert [points(one) for one in curves(chart)] == [list(places)]
    assert [points(one) for one in guides(chart)] == [[(0.0, 1.0), (100.0, 1.0)]]
    assert chart["layout"]["yaxis"]["type"] == "log"
    assert chart["layout"]["xaxis"].get("type") != "log"


def test_the_command_prints_every_frame(capsys):
    assert main(["--frequency", "4", "--frames", "2", "--rays", "64"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("320 triangles")
    assert len(lines) == 3 + 3 * 2
