"""Defects of intersection, normals, and the way off a surface."""

from __future__ import annotations

from mitsuba_ref.mutations.mutation import Edit, Mutation

DEFECTS = (
    Mutation(
        "fixed-epsilon",
        "new rays start 1e-3 off their surface, whatever the scene's size",
        (
            Edit(
                "integrators/stages/surface/surface.py",
                "place.offset * per_rounding + unlike_rounding",
                "place.offset * 0.0 + 1e-3",
            ),
        ),
        scene="kaleidoscope",
        tests=("test_ray_offset.py::test_the_smallest_gap_that_is_resolved",),
    ),
    Mutation(
        "leaf-loses-a-triangle",
        "a leaf of the hierarchy forgets its last primitive if it has more than six",
        (
            Edit(
                "accelerators/bvh/bvh_build.py",
                "count[node] = end - first",
                "count[node] = end - first - (end - first) // 7",
            ),
        ),
        scene="appel-teapot",
        tests=("test_bvh_build.py::test_random_soups",),
    ),
    Mutation(
        "box-left-too-early",
        "camera rays leave a box a tenth before its far side",
        (
            Edit(
                "accelerators/rays/box_entry.py",
                "leave = maximum(minimum(x0 * STRETCH, t), minimum(x1 * STRETCH, t))",
                "leave = maximum(minimum(x0 * 0.9, t), minimum(x1 * 0.9, t))",
            ),
        ),
        scene="appel-teapot",
        tests=("test_accelerators_agree.py::test_soups_of_every_kind[bvh-triangles]",),
    ),
    Mutation(
        "stream-leaves-boxes-too-early",
        "rays after a bounce leave a box a tenth before its far side",
        (
            Edit(
                "accelerators/bvh/streams/ray_streams.py",
                "return mask_bits(enter <= minimum(leave * STRETCH, t))",
                "return mask_bits(enter <= minimum(leave * 0.9, t))",
            ),
        ),
        scene="textured-room",
        tests=("test_accelerators_agree.py::test_soups_of_every_kind[wide-triangles]",),
    ),
    Mutation(
        "short-list-loses-a-ray",
        "of the last rays of a stream that go the same way one is forgotten",
        (
            Edit(
                "accelerators/bvh/streams/ray_streams.py",
                "stream.lists, queue, going, node, tally)",
                "stream.lists, queue, going - 1, node, tally)",
            ),
        ),
        scene="textured-room",
        tests=("test_accelerators_agree.py::test_soups_of_every_kind[wide-triangles]",),
    ),
    Mutation(
        "sphere-near-root-only",
        "a ray that starts inside of a sphere does not meet it",
        (
            Edit(
                "plugins/shapes/sphere.py",
                "t = select(first > 0.0, first, second)",
                "t = first",
            ),
        ),
        scene="whitted-spheres",
        tests=("test_sphere_and_cylinder.py::test_from_inside_the_far_root_counts",),
    ),
    Mutation(
        "smooth-normals-ignored",
        "vertex normals are read and not used",
        (
            Edit(
                "plugins/shapes/flat/triangle.py",
                "shading_normal = interpolated_normal("
                "triangles.normals, index, mask, u, v, normal)",
                "shading_normal = normal",
            ),
        ),
        scene="smooth-mesh",
        tests=("test_surface_points.py::test_shading_normals",),
    ),
    Mutation(
        "roots-where-monotone-only",
        "where g may have several roots along a ray, none is looked for",
        (
            Edit(
                "plugins/shapes/implicit/roots.py",
                "if half > narrowest and depth < _STACK:",
                "if half > narrowest and depth < 0:",
            ),
        ),
        scene="diffuse",
        tests=(
            "test_implicit_surfaces.py::test_no_first_root_is_missed_and_none_invented",
        ),
        remark="Mitsuba has no implicit surfaces",
    ),
    Mutation(
        "sine-without-chain-rule",
        "the slope of sin g is that of g",
        (
            Edit(
                "plugins/shapes/implicit/intervals.py",
                "return sine(a), multiply(cosine(a), da)",
                "return sine(a), da",
            ),
        ),
        scene="diffuse",
        tests=(
            "test_implicit_surfaces.py::"
            "test_the_range_of_a_wave_is_that_of_its_ends_and_peaks",
        ),
        remark="Mitsuba has no implicit surfaces",
    ),
    Mutation(
        "implicit-normals-as-points",
        "normals of an implicit surface are moved as vectors are",
        (
            Edit(
                "plugins/shapes/implicit/implicit.py",
                "unit_normal(surfaces.to_object, k, g,",
                "unit_normal(surfaces.to_world, k, g,",
            ),
        ),
        scene="diffuse",
        tests=("test_implicit_surfaces.py::test_normals_go_by_the_inverse_transpose",),
        remark="Mitsuba has no implicit surfaces",
    ),
    Mutation(
        "sdfgrid-second-root",
        "in a cell of a grid of distances, the pieces where a cubic turns are forgotten",
        (
            Edit(
                "plugins/shapes/implicit/trilinear.py",
                "if not square > 0.0:",
                "if not square > np.inf:",
            ),
        ),
        scene="sdfgrid",
        tests=("test_sdf_grids.py::test_the_first_root_of_cubics_is_numpys",),
    ),
    Mutation(
        "sdfgrid-normals-blended-aside",
        "smooth normals on a grid of distances weigh the wrong neighbour along x",
        (
            Edit(
                "plugins/shapes/implicit/sdf_normals.py",
                "x, y, z = x1 if a else x0,",
                "x, y, z = x0 if a else x1,",
            ),
        ),
        scene="sdfgrid",
        tests=("test_sdf_grids.py::test_hits_and_normals_are_mitsubas",),
    ),
    Mutation(
        "sdfgrid-normals-bend-no-end",
        "smooth normals ignore the neighbour beyond the end of a grid, as none is there",
        (
            Edit(
                "plugins/shapes/implicit/sdf_normals.py",
                "weight = 1.0 if plane < 1.0 else x - plane + 0.5",
                "weight = x - plane + 0.5",
            ),
        ),
        scene="sdfgrid",
        tests=("test_sdf_grids.py::test_hits_and_normals_are_mitsubas",),
    ),
    Mutation(
        "serialized-first-mesh",
        "every mesh of a serialized file is its first",
        (
            Edit(
                "scene_file/meshes/serialized_file.py",
                "content, table + index * entry)",
                "content, table)",
            ),
        ),
        scene="serialized",
        tests=("test_serialized_files.py::test_it_is_read_as_mitsuba_reads_it",),
    ),
    Mutation(
        "serialized-normals-dropped",
        "normals of a serialized file are dropped, and computed",
        (
            Edit(
                "scene_file/meshes/serialized_file.py",
                "judged_mesh(vertices, faces.astype(np.int32), normals, uvs,",
                "judged_mesh(vertices, faces.astype(np.int32), None, uvs,",
            ),
        ),
        scene="serialized",
        tests=("test_serialized_files.py::test_it_is_read_as_mitsuba_reads_it",),
    ),
    Mutation(
        "geometric-normal-for-light",
        "direct light is weighed by the cosine to the face instead of the smooth normal",
        (
            Edit(
                "integrators/stages/direct_light.py",
                "frame = frame_at(bsdf.form, bsdf.arithmetic, points, i)",
                "frame = frame_at(bsdf.form, bsdf.arithmetic, points, i)\n"
                "        seen = dot(load3(points.wo, i), load3(points.shading_normal, i))\n"
                "        flat = load3(points.normal, i)\n"
                "        flat = select3(seen > 0.0, flat, -flat)\n"
                "        frame = Frame(frame.s, frame.t, flat)",
            ),
            Edit(
                "integrators/stages/direct_light.py",
                "from renderer.plugins.sampling.arithmetic import to_local",
                "from renderer.plugins.sampling.arithmetic import Frame, to_local",
            ),
            Edit(
                "integrators/stages/direct_light.py",
                "from renderer.kernels.lanes.vectors import append3, length, load3",
                "from renderer.kernels.lanes.vectors import append3, dot, length, load3, "
                "select3",
            ),
        ),
        scene="smooth-mesh",
    ),
    Mutation(
        "shading-normal-for-offset",
        "new rays leave a surface along its shading normal",
        (
            Edit(
                "integrators/stages/surface/shading_frame.py",
                "normal = load3(points.normal, i)",
                "normal = load3(points.shading_normal, i)",
            ),
        ),
        scene="smooth-lamp",
        remark="it decides only where a ray leaves between the two normals' planes",
    ),
    Mutation(
        "instance-normal-by-matrix",
        "normals of instances are transformed like points",
        (
            Edit(
                "integrators/stages/surface/placement.py",
                "normal = transposed_times(back, place.normal)",
                "normal = times(out, place.normal)",
            ),
        ),
        scene="instances",
        tests=("test_instances.py::test_surface_points_are_mitsubas",),
    ),
    Mutation(
        "triangle-uv-swapped",
        "the two barycentric coordinates of a triangle change places",
        (
            Edit(
                "plugins/shapes/flat/triangle.py",
                "return divided(p, depth >= 0.0, t_max)",
                "found = divided(p, depth >= 0.0, t_max)\n"
                "    return Intersection(found.hit, found.t, found.v, found.u)",
            ),
        ),
        scene="smooth-mesh",
        tests=("test_triangle.py::test_both_methods_against_float64",),
    ),
    Mutation(
        "disk-is-a-square",
        "a disk reaches to the corners of its square",
        (
            Edit(
                "plugins/shapes/flat/disk.py",
                "x.hit & (x.u * x.u + x.v * x.v <= 1.0)",
                "x.hit & (x.u * x.u <= 1.0) & (x.v * x.v <= 1.0)",
            ),
        ),
        scene="analytic-shapes",
        tests=("test_flat_shapes.py::test_the_border_of_a_disk_belongs_to_it",),
    ),
)
