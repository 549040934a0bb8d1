"""Reconstruction filters, held against Mitsuba's own and against closed forms."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest

from renderer.errors import SceneError
from renderer.scene.reconstruction import (
    FILTER_NAMES,
    TABLE_STEPS,
    evaluate,
    lookup_weight,
    pixels_touched,
    tabulate,
)
from renderer.scene_file.description import ReconstructionFilter

mi.set_variant("scalar_rgb")

BOX = ReconstructionFilter("box", radius=0.5)
CATMULLROM = ReconstructionFilter("catmullrom", radius=2.0)
PAIRS = [
    (BOX, {"type": "box"}),
    (ReconstructionFilter("tent", radius=1.0), {"type": "tent"}),
    (ReconstructionFilter("tent", radius=2.5), {"type": "tent", "radius": 2.5}),
    (ReconstructionFilter("gaussian"), {"type": "gaussian"}),
    (
        ReconstructionFilter("gaussian", radius=1.2, stddev=0.3),
        {"type": "gaussian", "stddev": 0.3},
    ),
    (ReconstructionFilter("mitchell", radius=2.0), {"type": "mitchell"}),
    (
        ReconstructionFilter("mitchell", radius=2.0, b=0.1, c=0.7),
        {"type": "mitchell", "B": 0.1, "C": 0.7},
    ),
    (CATMULLROM, {"type": "catmullrom"}),
    (ReconstructionFilter("lanczos", radius=3.0), {"type": "lanczos"}),
    (ReconstructionFilter("lanczos", radius=2.0), {"type": "lanczos", "lobes": 2}),
]
each_pair = pytest.mark.parametrize(
    ("ours", "plugin"), PAIRS, ids=[f"{p['type']}-{len(p)}" for _, p in PAIRS]
)


def float32_error(rfilter):
    """What float32 arithmetic may leave: terms of size t cancel to about 1e-7 t.

    The gaussian's polynomial has terms up to 180 near its radius, the cubics' up to 20.
    """
    return {"gaussian": 3e-5, "mitchell": 3e-6, "catmullrom": 3e-6}.get(rfilter.name, 1e-6)


@each_pair
def test_formula_is_mitsubas(ours, plugin):
    """Same radius, and the same weight to float32 accuracy, beyond the radius too."""
    theirs = mi.load_dict(plugin)
    assert ours.radius == pytest.approx(theirs.radius())
    # Off the end points, where float32 and float64 may fall on different sides.
    x = np.linspace(-1.2, 1.2, 998) * ours.radius
    expected = np.array([theirs.eval(v) for v in x])
    np.testing.assert_allclose(
        evaluate(ours, x), expected, rtol=0, atol=float32_error(ours)
    )


@each_pair
def test_table_is_mitsubas(ours, plugin):
    """The film's staircase has Mitsuba's steps: same edges, same heights, 0 at the end."""
    theirs = mi.load_dict(plugin)
    # Three places in each step, away from its edges.
    inside = (np.arange(1.2 * TABLE_STEPS)[:, None] + [0.05, 0.5, 0.95]).ravel()
    x = inside * ours.radius / TABLE_STEPS
    expected = np.array([theirs.eval_discretized(v) for v in x])
    weights = lookup_weight(tabulate(ours), ours.radius, -x)
    np.testing.assert_allclose(weights, expected, rtol=0, atol=float32_error(ours))


@pytest.mark.parametrize("position", [(3.0, 2.5), (2.37, 3.81), (0.1, 4.99), (5.6, 1.2)])
@pytest.mark.parametrize("name", [n for n in FILTER_NAMES if n != "box"])
def test_a_sample_reaches_the_pixels_that_mitsubas_block_gives_it(name, position):
    """One sample put into an image block: which pixels get which weight, rim included.

    (3.0, 2.5) puts pixels exactly at a whole radius, the rule's edge case.
    """
    plugin = {"type": name}
    radius = mi.load_dict(plugin).radius()
    rfilter = ReconstructionFilter(name, radius=radius)
    size = 6
    block = mi.ImageBlock([size, size], [0, 0], 1, mi.load_dict(plugin), border=False)
    block.put(list(position), [1.0])

    table = tabulate(rfilter)
    along = np.zeros((2, size))
    for axis, p in enumerate(position):
        for i in pixels_touched(p, radius, size):
            along[axis, i] = lookup_weight(table, radius, i + 0.5 - p)
    ours = along[1][:, None] * along[0][None, :]
    np.testing.assert_allclose(ours, np.array(block.tensor())[..., 0], rtol=0, atol=4e-5)


def test_unknown_filter_names_what_there_is():
    """A misspelt name is answered with the list, not with a KeyError."""
    with pytest.raises(SceneError, match=r"'sinc'; there are box,"):
        evaluate(ReconstructionFilter("sinc"), 0.0)
