"""That the scenes of the chapter on structures are the stress that its rows speak of.

That each method holds before its limit and fails behind it is asserted with all rows.
"""

from __future__ import annotations

import numpy as np

from renderer.accelerators.build import build_accelerator
from renderer.kernels.records.batch import PRIMITIVES
from reports.accelerator_trials.meshes import triangle_surfaces
from reports.limits.structures import every, stadium, walls
from reports.limits.structures.work import counted, seen_from, soup_mesh


def test_the_wall_lies_on_the_cut():
    """The middle is 0 exactly, in float32 too, and both trees cut there first."""
    mesh = soup_mesh(walls.corners_at(16, 0.0))
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    assert np.array_equal(low + high, np.zeros(3)) and high[0] == 1.0
    surfaces = triangle_surfaces(mesh)
    order = np.arange(mesh.triangles)
    octree = build_accelerator("triangles", surfaces, order, "octree", 3.0)
    tree = build_accelerator("triangles", surfaces, order, "kd-middle", 3.0)
    for root in (octree.plane[0], tree.plane[0]):
        assert root.tolist() == [1.0, 0.0, 0.0, 0.0]


def test_rays_start_on_planes_of_the_structures():
    """Those that the rays meet: built for the reach of the rays themselves."""
    places = every.on_planes()
    reach = float(np.abs(places).sum(axis=1).max())
    assert len(places) > 140 and reach == every.REACH
    surfaces, order = triangle_surfaces(every.BALL), np.arange(every.BALL.triangles)
    octree = build_accelerator("triangles", surfaces, order, "octree", reach)
    bvh = build_accelerator("triangles", surfaces, order, "bvh", reach)
    tree = build_accelerator("triangles", surfaces, order, "kd-sah", reach)
    for axis in range(3):
        cuts = [t.plane[t.plane[:, axis] == 1.0, 3] for t in (octree, tree)]
        planes = np.concatenate((bvh.bounds[:, axis], *cuts))
        assert np.all(np.isin(places[:-1, axis], planes))


def test_the_teapot_is_in_one_cell_of_a_wide_stadium():
    """Each ray at it tests all its 4000 triangles, and the two of the field."""
    mesh = stadium.at_width(1000.0)
    tests = counted("grid", mesh, seen_from(mesh))[PRIMITIVES]
    assert np.all(tests >= 4000)
