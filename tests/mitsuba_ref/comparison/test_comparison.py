"""The verdict: what must pass passes, and each error by hand is caught by name.

Mitsuba stands on both sides, so that each injected error is the only one.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mitsuba_stand_in import write_scene

from mitsuba_ref.ladder.aovs import TOLERANCES, compare_aovs
from mitsuba_ref.ladder.evidence import Evidence, compare
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.reference.render import render_reference

SIZE = {"width": "48", "height": "36"}


class Scene:
    """Mitsuba's arrays of one scene."""

    def __init__(self, folder: Any, *, deterministic: bool) -> None:
        self.deterministic = deterministic
        self.path = write_scene(folder, deterministic=deterministic)
        count = 2 if deterministic else 4
        self.references = [self.picture(seed) for seed in range(100, 100 + count)]
        self.aovs = self.render("aovs")

    def render(self, kind: Any, seed: int = 0) -> dict[str, np.ndarray]:
        parameters = SIZE | {"spp": "1" if self.deterministic else "256"}
        return render_reference(
            RenderRequest(str(self.path), parameters, kind=kind, seed=seed, box_filter=True)
        ).arrays

    def picture(self, seed: int) -> np.ndarray:
        return self.render("image", seed)["pixels"]

    def compare(self, ours: np.ndarray, aovs: Any = None) -> Evidence:
        return compare(
            ours,
            self.references,
            self.aovs if aovs is None else aovs,
            self.aovs,
            deterministic=self.deterministic,
        )


@pytest.fixture(scope="module")
def noisy(tmp_path_factory):
    return Scene(tmp_path_factory.mktemp("noisy"), deterministic=False)


@pytest.fixture(scope="module")
def still(tmp_path_factory):
    return Scene(tmp_path_factory.mktemp("still"), deterministic=True)


@pytest.fixture(params=["noisy", "still"])
def scene(request, noisy, still):
    return {"noisy": noisy, "still": still}[request.param]


def failed(comparison: Evidence) -> set[str]:
    """Return the names of what failed; the verdict must agree."""
    names = {name for name, metric in comparison.metrics.items() if metric.passed is False}
    names |= {aov.name for aov in comparison.aovs if not aov.passed}
    assert (comparison.verdict != "pass") == bool(names) == bool(comparison.reasons)
    return names


def shifted_camera(scene: Scene, pixels: float) -> dict[str, dict[str, np.ndarray]]:
    """Return picture and AOVs of the scene through a film that is a little to the side."""
    moved = scene.path.with_name("moved.xml")
    offset = f'<float name="principal_point_offset_x" value="{pixels / 48}"/>'
    text = scene.path.read_text()
    moved.write_text(text.replace('<float name="fov"', offset + '<float name="fov"'))
    original, scene.path = scene.path, moved
    try:
        return {kind: scene.render(kind, seed=9) for kind in ("image", "aovs")}
    finally:
        scene.path = original


def test_another_seed_passes(scene):
    assert failed(scene.compare(scene.picture(9))) == set()


def test_the_identical_picture_passes(scene):
    comparison = scene.compare(scene.references[0])
    assert failed(comparison) == set()
    assert comparison.metrics["ssim"].value == pytest.approx(1.0)
    assert comparison.metrics["flip"].value == 0.0


def test_ten_other_seeds_pass(noisy):
    """A test that is red once in ten is no test: the floor must not be met by luck."""
    for seed in range(10, 20):
        assert failed(noisy.compare(noisy.picture(seed))) == set()


def test_half_a_pixel_to_the_side_fails(scene):
    """The classic registration error: in the picture and in every geometric AOV."""
    moved = shifted_camera(scene, 0.5)
    names = failed(scene.compare(moved["image"]["pixels"], moved["aovs"]))
    assert {"rmse", "depth", "position"} <= names


def test_half_a_pixel_is_seen_in_the_picture_alone(scene):
    """Right AOVs do not excuse a wrong picture."""
    moved = shifted_camera(scene, 0.5)
    assert "rmse" in failed(scene.compare(moved["image"]["pixels"]))


def test_a_twentieth_of_a_pixel_is_seen_in_the_aovs(scene):
    moved = shifted_camera(scene, 0.05)
    assert {"depth", "position"} <= failed(
        scene.compare(scene.references[0], moved["aovs"])
    )


def test_a_picture_upside_down_fails(scene):
    assert "rmse" in failed(scene.compare(scene.references[0][::-1]))


def test_a_missing_cosine_fails(still):
    """Direct light divided by its cosine: what a renderer without it would show."""
    to_light = np.array([2.0, 4.0, 3.0]) - still.aovs["position"]
    to_light /= np.linalg.norm(to_light, axis=-1, keepdims=True)
    cosine = np.sum(to_light * still.aovs["sh_normal"], axis=-1, keepdims=True)
    hit = still.aovs["depth"] > 0
    broken = np.where(hit, still.references[0] / np.maximum(cosine, 0.05), 0.0)
    assert {"rmse", "edge_disagreement"} <= failed(still.compare(broken.astype(np.float32)))


def test_swapped_indices_of_refraction_fail(noisy, tmp_path):
    """A glass ball against a bubble of air in glass: the same geometry, other light."""
    glass = '<bsdf type="dielectric"><float name="{}" value="1.5"/>{}</bsdf>'
    other = '<float name="{}" value="1.0"/>'
    text = noisy.path.read_text()
    ball = '<shape type="sphere">\n    <ref id="red"/>'
    assert ball in text
    pictures = {}
    for inside, outside in (("int_ior", "ext_ior"), ("ext_ior", "int_ior")):
        bsdf = glass.format(inside, other.format(outside))
        path = tmp_path / f"{inside}.xml"
        path.write_text(text.replace(ball, f'<shape type="sphere">{bsdf}'))
        request = RenderRequest(str(path), SIZE | {"spp": "64"})
        pictures[inside] = [
            render_reference(replace(request, seed=seed)).pixels for seed in range(5)
        ]
    right, wrong = pictures["int_ior"], pictures["ext_ior"]
    assert failed(compare(right[0], right[1:])) == set()
    assert {"rmse", "tile_bias"} <= failed(compare(wrong[0], right[1:]))


@pytest.mark.parametrize("scale", [1.005, 0.995])
def test_half_a_per_cent_of_scale_fails(noisy, scale):
    """Far below the RMSE's tolerance under this noise: the tests of the mean find it."""
    names = failed(noisy.compare(noisy.picture(9) * np.float32(scale)))
    assert "mean_difference" in names
    assert "rmse" not in names


@pytest.mark.parametrize("scale", [1.001, 0.999])
def test_one_part_in_a_thousand_fails_without_noise(still, scale):
    assert "rmse" in failed(still.compare(still.references[0] * np.float32(scale)))


@pytest.mark.parametrize("scale", [1.000001, 0.999999])
def test_one_part_in_a_million_passes_without_noise(still, scale):
    assert failed(still.compare(still.references[0] * np.float32(scale))) == set()


def test_blur_fails_although_it_has_less_noise(noisy):
    """A smooth picture can have a smaller RMSE than the floor and still be wrong."""
    picture = noisy.picture(9).astype(np.float64)
    for axis in (0, 1):
        for _ in range(4):
            picture = 0.5 * picture + 0.25 * (
                np.roll(picture, 1, axis) + np.roll(picture, -1, axis)
            )
    assert "tile_bias" in failed(noisy.compare(picture.astype(np.float32)))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_finite_fail_loudly_with_their_count(scene, bad):
    """NaN compares as neither larger nor smaller: no metric may be computed before."""
    ours = scene.references[0].copy()
    ours[3, 4] = bad
    comparison = scene.compare(ours)
    assert failed(comparison) == {"rmse"}
    assert "NOT FINITE" in comparison.reasons[0]
    nan, inf = (3, 0) if np.isnan(bad) else (0, 3)
    assert (comparison.finite.ours_nan, comparison.finite.ours_inf) == (nan, inf)
    assert comparison.metrics["rmse"].value is None


def test_values_that_are_not_finite_in_the_reference_fail_too(scene):
    references = [picture.copy() for picture in scene.references]
    references[1][0, 0, 0] = np.nan
    comparison = compare(scene.references[0], references, deterministic=scene.deterministic)
    assert comparison.verdict == "not-finite"
    assert comparison.finite.reference_nan == 1


def test_a_nan_in_an_aov_fails(scene):
    aovs = {name: values.copy() for name, values in scene.aovs.items()}
    aovs["depth"][5, 5] = np.nan
    comparison = scene.compare(scene.references[0], aovs)
    assert comparison.verdict == "not-finite"
    assert comparison.finite.ours_nan == 1


@pytest.mark.parametrize("count", [0, 1])
def test_a_missing_reference_is_a_failure(scene, count):
    """Nothing was compared, so nothing passed."""
    comparison = compare(scene.references[0], scene.references[:count])
    assert comparison.verdict == "broken"
    assert f"{count} reference pictures" in comparison.reasons[0]


def test_another_size_is_a_failure(scene):
    comparison = compare(scene.references[0][:-1], scene.references)
    assert comparison.verdict == "size-mismatch"
    assert "(35, 48, 3)" in comparison.reasons[0]


def test_a_missing_aov_is_a_failure(scene):
    aovs = {name: values for name, values in scene.aovs.items() if name != "sh_normal"}
    assert failed(scene.compare(scene.references[0], aovs)) == {"sh_normal"}


@pytest.mark.parametrize("factor", [1.01, 0.99])
@pytest.mark.parametrize("kind", [kind for kind in TOLERANCES if kind != "uv"])
def test_an_error_of_one_per_cent_in_an_aov_fails(scene, kind, factor):
    aovs = dict(scene.aovs)
    aovs[kind] = aovs[kind] * np.float32(factor)
    assert kind in failed(scene.compare(scene.references[0], aovs))


@pytest.mark.parametrize("off", [0.01, -0.01])
@pytest.mark.parametrize("kind", TOLERANCES)
def test_each_component_of_an_aov_counts_with_both_signs(kind, off):
    """One component of a hand-made wall a hundredth off, all others exact."""
    reference = two_triangles(0)
    for component in range(reference[kind].shape[-1]):
        wrong = reference[kind].copy()
        wrong[..., component] += off
        results = compare_aovs(reference | {kind: wrong}, reference)
        broken = [result.name for result in results if not result.passed]
        assert broken == [kind], f"component {component}: {broken}"


@pytest.mark.parametrize("off", [1, -1])
def test_indices_off_by_one_fail(scene, off):
    """Every hit has the right place and the wrong name."""
    hit = scene.aovs["depth"] > 0
    aovs = dict(scene.aovs)
    aovs["shape_index"] = aovs["shape_index"] + off * hit
    assert failed(scene.compare(scene.references[0], aovs)) == {"shape_index"}


def test_a_picture_that_is_all_edge_proves_nothing(still):
    """Single bright pixels everywhere mask the whole picture: the cap says so."""
    dotted = [picture.copy() for picture in still.references]
    for picture in dotted:
        picture[::3, ::3] += 100.0
    comparison = compare(dotted[0], dotted, still.aovs, still.aovs, deterministic=True)
    assert "masked_fraction" in failed(comparison)


def test_noise_in_a_scene_called_deterministic_fails(noisy):
    """The label is checked against Mitsuba: two seeds must give the same picture."""
    references = noisy.references
    comparison = compare(
        references[0], references, noisy.aovs, noisy.aovs, deterministic=True
    )
    assert "rmse" in failed(comparison)


@pytest.mark.parametrize("off", [0.5, -0.5])
def test_four_wrong_pixels_of_1728_on_an_outline_fail(still, off):
    """The mask of edges excuses the last bit of a float here and there, not a contour."""
    from mitsuba_ref.metrics.edges import silhouettes

    ours = still.references[0].copy()
    rows, columns = np.nonzero(silhouettes(still.aovs))
    wrong = slice(0, ours.shape[0] * ours.shape[1] // 400)
    ours[rows[wrong], columns[wrong]] += off
    assert failed(still.compare(ours)) == {"edge_disagreement", "rmse_everywhere"}


def test_a_wide_tolerance_for_the_plain_rmse_leaves_the_trimmed_one_as_it_is(noisy):
    """A caustic's RMSE may wander; without its fireflies it may not."""
    rng = np.random.default_rng(1)
    noise = 0.6 * noisy.compare(noisy.references[0]).metrics["rmse"].floor
    ours = noisy.picture(9) + noise * rng.standard_normal((36, 48, 3)).astype(np.float32)
    wide = compare(ours, noisy.references, rmse_factor=2.5).metrics
    assert wide["rmse"].passed
    assert wide["trimmed_rmse"].tolerance == 1.25 * wide["trimmed_rmse"].floor


@pytest.mark.parametrize("off", [1.0, -1.0])
def test_errors_hidden_on_edges_are_counted(still, off):
    """Silhouettes may differ, but not all of them: here every masked pixel is wrong."""
    clean = still.compare(still.references[0])
    assert clean.metrics["masked_fraction"].value > 0.1
    from mitsuba_ref.metrics.edges import discontinuities, silhouettes

    edge = silhouettes(still.aovs) | discontinuities(still.references[0])
    ours = still.references[0].copy()
    ours[edge] += off
    comparison = still.compare(ours)
    assert failed(comparison) == {"edge_disagreement", "rmse_everywhere"}


@pytest.mark.parametrize("factor", [1.012, 0.988])
@pytest.mark.parametrize("channel", [0, 1, 2])
def test_an_edge_that_is_over_one_per_cent_off_is_counted(channel, factor):
    """Of the brightest channel, with either sign; 0.8 % is none.

    Two halves of two colours; 20 of 1600 pixels along the edge between them are wrong, too
    few and too little for every other metric.
    """
    left, right = np.roll([0.9, 0.5, 0.3], channel), np.roll([0.4, 0.2, 0.1], channel)
    picture = np.where((np.arange(40) < 20)[:, None], left, right).astype(np.float32)
    reference = np.tile(picture, (40, 1, 1))
    ours = reference.copy()
    ours[10:20, 19:21, channel] *= np.float32(factor)
    comparison = compare(ours, [reference, reference], deterministic=True)
    assert failed(comparison) == {"edge_disagreement"}, comparison.reasons
    assert comparison.metrics["edge_disagreement"].value == pytest.approx(20 / 1600)
    ours = reference + np.float32(2 / 3) * (ours - reference)
    assert failed(compare(ours, [reference, reference], deterministic=True)) == set()


def two_triangles(on_the_diagonal: int) -> dict[str, np.ndarray]:
    """A square, seen from the front, cut along a row of pixels; each half has its uv."""
    y, x = np.mgrid[:40, :40].astype(np.float32)
    lower = np.where(x == y, on_the_diagonal, x < y).astype(np.float32)
    u = np.where(lower == 1.0, x / 40, 1.0 - y / 80)
    one = np.ones((40, 40))
    normal = np.stack([0 * one, 0 * one, one], axis=-1)
    aovs = {
        "depth": one[..., None],
        "position": np.stack([x, y, one], axis=-1),
        "geo_normal": normal,
        "sh_normal": normal,
        "uv": np.stack([u, y / 40], axis=-1),
        "albedo": normal,
        "shape_index": one[..., None],
        "prim_index": lower[..., None],
    }
    return {kind: values.astype(np.float32) for kind, values in aovs.items()}


def test_a_ray_along_the_diagonal_of_a_square_may_have_the_uv_of_either_half():
    """One pixel in forty, all explained; a wrong uv next to the diagonal is still found."""
    ours, reference = two_triangles(0), two_triangles(1)
    assert all(result.passed for result in compare_aovs(ours, reference))
    ours["uv"][3:6, 20:30] += 0.01
    assert [r.name for r in compare_aovs(ours, reference) if not r.passed] == ["uv"]
    elsewhere = two_triangles(0)
    elsewhere["prim_index"][...] = 7.0  # no tie explains as many
    failed = [r.name for r in compare_aovs(elsewhere, reference) if not r.passed]
    assert failed == ["uv", "prim_index"]


def test_a_ray_along_an_edge_of_a_mesh_may_have_either_facets_normal():
    """Both hit one point of one shape; the same facet with another normal is a defect."""
    ours, reference = two_triangles(0), two_triangles(1)
    for kind in ("geo_normal", "sh_normal", "albedo"):
        for aovs in (ours, reference):
            aovs[kind] = np.where(aovs["prim_index"] > 0.0, aovs[kind], 0.5)
    assert all(result.passed for result in compare_aovs(ours, reference))
    ours["geo_normal"][3:6, 20:30] += 0.01
    failed = [r.name for r in compare_aovs(ours, reference) if not r.passed]
    assert failed == ["geo_normal"]
    ours, reference = two_triangles(0), two_triangles(1)
    ours["position"][np.diag_indices(40)] += 0.1  # not one point, so not a tie
    failed = [r.name for r in compare_aovs(ours, reference) if not r.passed]
    assert failed == ["position", "uv", "prim_index"]


@pytest.mark.parametrize("kind", ["geo_normal", "sh_normal", "uv"])
def test_a_block_of_another_primitive_is_not_on_an_edge(kind):
    """4 % of the pixels, fewer than may be tied: an edge is thin."""
    ours, reference = two_triangles(0), two_triangles(0)
    block = np.s_[4:12, 26:34]
    ours["prim_index"][block] = 7.0
    ours[kind][block] += 0.3
    failed = {r.name for r in compare_aovs(ours, reference) if not r.passed}
    assert failed == {kind, "prim_index"}


def nothing(**changed: np.ndarray) -> dict[str, np.ndarray]:
    """AOVs of a picture all of whose rays miss."""
    blank = {kind: np.zeros_like(values) for kind, values in two_triangles(0).items()}
    return blank | changed


def test_rays_that_all_miss_agree_where_ours_miss_too():
    """There is no value to measure, and the index of nothing is compared everywhere."""
    results = compare_aovs(nothing(), nothing())
    assert all(result.passed for result in results)
    assert all(result.compared_pixels == 1600 for result in results)
    assert results[0].value is None
    assert "0 hit something" in results[0].meaning


def test_one_ray_of_ours_that_hits_where_all_should_miss_is_found():
    """A single pixel: no quantile may hide it, since nothing may be there."""
    depth = np.zeros((40, 40, 1), np.float32)
    depth[7, 9] = 2.0
    failed = [r for r in compare_aovs(nothing(depth=depth), nothing()) if not r.passed]
    assert [r.name for r in failed] == ["depth"]
    assert "of ours 1 hit something" in failed[0].meaning


def test_a_picture_of_nothing_passes_and_says_what_was_compared():
    """Until then it failed as one whose AOVs could not be measured."""
    sky = np.full((40, 40, 3), 0.5, np.float32)
    seen = compare(sky, [sky, sky], nothing(), nothing(), deterministic=True)
    assert (seen.verdict, seen.reasons) == ("pass", ())
    assert "the colours of 1600 pixels of background" in seen.notes[0]
    other = compare(1.01 * sky, [sky, sky], nothing(), nothing(), deterministic=True)
    assert other.verdict == "fail"


def test_positions_may_be_as_coarse_as_their_coordinates():
    """At 1e4 a float32 steps by 1e-3: two steps pass at a depth of 1, sixteen do not."""
    reference = two_triangles(0)
    reference["position"] = reference["position"] + np.float32(1e4)
    for steps, passes in ((2, True), (16, False)):
        position = reference["position"] + np.float32(steps * 2.0**-10)
        results = compare_aovs(reference | {"position": position}, reference)
        assert [r.name for r in results if not r.passed] == ([] if passes else ["position"])
