"""No broken array on either side ever gets "pass", wherever in it the damage is.

The undamaged arrays do pass, so each example differs from a pass by one defect.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from canned_renderers import CHANNELS, HEIGHT, WIDTH, picture, wall
from hypothesis import given, settings
from hypothesis import strategies as st

from mitsuba_ref.ladder.evidence import compare
from mitsuba_ref.ladder.preconditions import find_obstacle
from mitsuba_ref.records.verdicts import VERDICTS

Damage = Callable[[np.ndarray], np.ndarray]
SIDES = ("ours", "reference")


def arrays(*, still: bool) -> dict[str, Any]:
    """Return what `compare` takes: four noisy references, or two of a smooth picture."""
    ramp = np.linspace(0.4, 0.6, WIDTH, dtype=np.float32)[None, :, None]
    smooth = np.ascontiguousarray(np.broadcast_to(ramp, (HEIGHT, WIDTH, 3)))
    pictures = [smooth] * 3 if still else [picture(seed) for seed in range(5)]
    return {
        "ours": pictures[0],
        "references": pictures[1:],
        "ours_aovs": wall(),
        "reference_aovs": wall(),
    }


def value_at(bad: float, place: float) -> Damage:
    def damage(array: np.ndarray) -> np.ndarray:
        array = array.copy()
        array.flat[int(place * array.size)] = bad
        return array

    return damage


VALUES = st.builds(
    value_at,
    st.sampled_from([np.nan, np.inf, -np.inf]),
    st.floats(0.0, 1.0, exclude_max=True),
)
SHAPES: dict[str, Damage] = {
    "no rows": lambda array: array[:0],
    "no columns": lambda array: array[:, :0],
    "no channels": lambda array: array[..., :0],
    "nothing": lambda array: np.zeros((0, 0, 0), np.float32),
    "a row less": lambda array: array[1:],
    "a column less": lambda array: array[:, 1:],
    "one row": lambda array: array[:1],
    "one pixel": lambda array: array[:1, :1],
    "a channel more": lambda array: np.concatenate([array, array[..., :1]], axis=-1),
    "no third axis": lambda array: array[..., 0],
    "a fourth axis": lambda array: array[None],
    "on its side": lambda array: array.swapaxes(0, 1),
    "a list of pixels": lambda array: array.reshape(-1, array.shape[-1]),
    "twice the size": lambda array: array.repeat(2, axis=0).repeat(2, axis=1),
}


def damaged(scene: dict[str, Any], side: str, what: str, damage: Damage) -> dict[str, Any]:
    """Return the scene with one array broken: the picture, or an AOV by its name."""
    if what in CHANNELS:
        aovs = dict(scene[f"{side}_aovs"])
        aovs[what] = damage(aovs[what])
        return {**scene, f"{side}_aovs": aovs}
    if side == "ours":
        return {**scene, "ours": damage(scene["ours"])}
    return {**scene, "references": [*scene["references"][:-1],
                                    damage(scene["references"][-1])]}  # fmt: skip


def verdict(scene: dict[str, Any], *, still: bool) -> str:
    found = compare(**scene, deterministic=still)
    assert bool(found.reasons) == (found.verdict != "pass")
    return found.verdict


@pytest.mark.parametrize("still", [False, True])
def test_undamaged_arrays_pass(still):
    """Without this, the tests below could not fail."""
    assert verdict(arrays(still=still), still=still) == "pass"


@given(
    st.booleans(), st.sampled_from(SIDES), st.sampled_from(["picture", *CHANNELS]), VALUES
)
@settings(max_examples=150, deadline=None, derandomize=True)
def test_a_value_that_is_not_finite_is_never_a_pass(still, side, what, damage):
    scene = damaged(arrays(still=still), side, what, damage)
    assert verdict(scene, still=still) == "not-finite"


@pytest.mark.parametrize("still", [False, True])
@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("what", ["picture", "depth", "uv"])
@pytest.mark.parametrize("shape", SHAPES)
def test_another_shape_is_never_a_pass(still, side, what, shape):
    scene = damaged(arrays(still=still), side, what, SHAPES[shape])
    assert verdict(scene, still=still) == "size-mismatch"


@pytest.mark.parametrize("still", [False, True])
@pytest.mark.parametrize("shape", ["no rows", "nothing", "a channel more", "no third axis"])
def test_the_same_wrong_shape_everywhere_is_never_a_pass(still, shape):
    """Equal on both sides, and yet nothing, or no picture: agreement alone is no proof."""
    scene = arrays(still=still)
    scene["ours"] = SHAPES[shape](scene["ours"])
    scene["references"] = [SHAPES[shape](one) for one in scene["references"]]
    assert verdict(scene, still=still) == "size-mismatch"


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_the_same_bad_value_everywhere_is_never_a_pass(bad):
    """An infinite floor would allow any distance, and NaN is over no limit."""
    scene = arrays(still=False)
    damage = value_at(bad, 0.5)
    scene["ours"] = damage(scene["ours"])
    scene["references"] = [damage(one) for one in scene["references"]]
    assert verdict(scene, still=False) == "not-finite"


@pytest.mark.parametrize("still", [False, True])
@pytest.mark.parametrize("kind", CHANNELS)
def test_an_aov_that_we_lack_is_never_a_pass(still, kind):
    scene = arrays(still=still)
    del scene["ours_aovs"][kind]
    assert verdict(scene, still=still) == "fail"


@given(st.floats(1e30, 3e38), st.booleans())
@settings(max_examples=20, deadline=None, derandomize=True)
def test_a_number_whose_square_overflows_is_never_a_pass(large, still):
    """Finite in float32, infinite as a float32 square: no metric may lose its head."""
    scene = damaged(arrays(still=still), "ours", "picture", value_at(large, 0.5))
    assert verdict(scene, still=still) == "fail"


@given(st.floats(10.0, 3e38))
@settings(max_examples=20, deadline=None, derandomize=True)
def test_a_firefly_of_mitsuba_s_excuses_nothing(large):
    """It lifts the floor of the plain RMSE to any height; 15 % too bright is still seen."""
    scene = damaged(arrays(still=False), "reference", "picture", value_at(large, 0.5))
    scene["ours"] = scene["ours"] * np.float32(1.15)
    assert verdict(scene, still=False) == "fail"


@pytest.mark.parametrize("count", [0, 1])
def test_too_few_references_are_never_a_pass(count):
    """The harness requests four: fewer are a bug on our side."""
    obstacle = find_obstacle([picture(0)], [picture(1)] * count)
    assert obstacle is not None
    assert obstacle.verdict == "broken"
    assert VERDICTS["broken"].advice in obstacle.sentence
