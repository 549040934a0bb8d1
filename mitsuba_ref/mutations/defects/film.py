"""Defects of camera, film and picture files."""

from __future__ import annotations

from mitsuba_ref.mutations.mutation import Edit, Mutation

NO_BORDER = "comparisons render with the box, which reaches nothing beyond its pixel"

DEFECTS = (
    Mutation(
        "neighbours-change-places",
        "the film takes the samples of every two pixels of a row for each other",
        (
            Edit(
                "kernels/records/tile.py",
                "    x = (x << level) | (later & inside)\n",
                "    x = ((x ^ 1) << level) | (later & inside)\n",
            ),
        ),
        scene="textured-room",
    ),
    Mutation(
        "half-a-pixel-right",
        "the picture is shifted by half a pixel",
        (
            Edit(
                "plugins/sensors/pinhole.py",
                "x, y = self.xres / 2.0 + border",
                "x, y = self.xres / 2.0 - 0.5 + border",
            ),
        ),
        scene="depth-and-normals",
    ),
    Mutation(
        "mirrored-picture",
        "left and right change places",
        (
            Edit(
                "plugins/sensors/pinhole.py",
                "x = -left * (width / film.width)",
                "x = left * (width / film.width)",
            ),
        ),
        scene="depth-and-normals",
    ),
    Mutation(
        "principal-point-other-way",
        "principal_point_offset_x moves the picture the other way",
        (
            Edit(
                "plugins/sensors/pinhole.py",
                "+ x * (camera.principal_point_offset_x * film.width)",
                "- x * (camera.principal_point_offset_x * film.width)",
            ),
        ),
        scene="cropped-film",
    ),
    Mutation(
        "far-plane-ignored",
        "camera rays reach beyond far_clip",
        (
            Edit(
                "plugins/sensors/perspective.py",
                "np.float32(camera.far) * along - near",
                "np.float32(np.inf) * along - near",
            ),
        ),
        scene="smooth-lamp",
    ),
    Mutation(
        "near-plane-by-distance",
        "near_clip is a distance along the ray instead of the depth of a plane",
        (
            Edit(
                "plugins/sensors/perspective.py",
                "near = np.float32(camera.near) * along",
                "near = np.float32(camera.near) + 0.0 * along",
            ),
        ),
        scene="smooth-lamp",
        remark="few pixels of few scenes lie between the plane and the sphere",
    ),
    Mutation(
        "focus-by-distance",
        "a thin lens is focused on a sphere around it instead of a plane",
        (
            Edit(
                "plugins/sensors/thinlens.py",
                "direction = normalize(in_focus - on_lens)",
                "direction = normalize(normalize(in_focus) * np.float32(4.2) - on_lens)",
            ),
        ),
        scene="thinlens",
        tests=("test_simple_path_tracer.py::test_the_same_paths_find_the_same_light",),
    ),
    Mutation(
        "half-a-lens",
        "a thin lens has half the radius that the file says",
        (
            Edit(
                "plugins/sensors/thinlens.py",
                "left * camera.aperture_radius, up * camera.aperture_radius",
                "left * (camera.aperture_radius / 2), up * (camera.aperture_radius / 2)",
            ),
        ),
        scene="thinlens",
        tests=("test_simple_path_tracer.py::test_the_same_paths_find_the_same_light",),
    ),
    Mutation(
        "parallel-film-is-square",
        "an orthographic film is as high as it is wide",
        (
            Edit(
                "plugins/sensors/orthographic.py",
                "left + up * (film.height / film.width)",
                "left + up * 1.0",
            ),
        ),
        scene="orthographic",
        tests=("test_simple_path_tracer.py::test_the_same_paths_find_the_same_light",),
    ),
    Mutation(
        "parallel-far-plane-from-camera",
        "far_clip is taken from the near plane on",
        (
            Edit(
                "plugins/sensors/orthographic.py",
                "float(camera.far_clip - camera.near_clip)",
                "float(camera.far_clip)",
            ),
        ),
        scene="orthographic",
    ),
    Mutation(
        "no-antialiasing",
        "every sample of a pixel lies at its centre",
        (
            Edit(
                "integrators/stages/film/camera_rays.py",
                "px = to_f32(x + tile.x) + load_row(film, 0, first)",
                "px = to_f32(x + tile.x) + 0.5",
            ),
            Edit(
                "integrators/stages/film/camera_rays.py",
                "py = to_f32(y + tile.y) + load_row(film, 1, first)",
                "py = to_f32(y + tile.y) + 0.5",
            ),
        ),
        scene="cornell-box",
    ),
    Mutation(
        "filter-not-normalised",
        "a pixel is divided by the number of its samples, not by their weights",
        (
            Edit(
                "integrators/stages/film/film.py",
                "load_four(splats, 0, i) + value * weight)",
                "load_four(splats, 0, i) + select(lane_index_4() == np.int32(channels - 4 "
                "* group), value, value * weight))",
            ),
        ),
        scene="cropped-film",
        tests=("test_film.py::test_one_whole_tile",),
        remark="a replay takes the box filter",
    ),
    Mutation(
        "filter-off-centre",
        "the reconstruction filter is centred on a pixel's corner",
        (
            Edit(
                "integrators/stages/film/film.py",
                "px = np.float64(load_one(film, 0, slot)) - tile.x + border - 0.5",
                "px = np.float64(load_one(film, 0, slot)) - tile.x + border - 0.25",
            ),
        ),
        scene="cropped-film",
        tests=("test_film.py::test_one_whole_tile",),
        remark="a replay takes the box filter",
    ),
    Mutation(
        "border-not-sampled",
        "`sample_border` is read and forgotten",
        (Edit("scene_file/description.py", "if not self.sample_border:", "if True:"),),
        scene="sample_border",
        tests=(
            "test_sample_border.py::test_each_pixel_of_the_edge_has_samples_on_all_sides",
        ),
        remark=NO_BORDER,
    ),
    Mutation(
        "border-one-pixel-less",
        "the samples beyond the film end one pixel before the filter does",
        (
            Edit(
                "scene_file/description.py",
                "return math.ceil(self.rfilter.radius - 0.5 - 2.0 * 1500.0 * 2.0**-24)",
                "return math.floor(self.rfilter.radius - 0.5)",
            ),
        ),
        scene="sample_border",
        tests=("test_sample_border.py::test_the_samples_are_mitsubas",),
        remark=NO_BORDER,
    ),
    Mutation(
        "clamped-at-ten",
        "a sample's radiance is at most 10",
        (
            Edit(
                "integrators/render_tiles.py",
                "            add_to_tile(\n",
                "            for channel in range(3):\n"
                "                for slot in range(work.radiance.shape[1]):\n"
                "                    shown = min(work.radiance[channel, slot], 10.0)\n"
                "                    work.radiance[channel, slot] = shown\n"
                "            add_to_tile(\n",
            ),
        ),
        scene="cornell-box",
    ),
    Mutation(
        "film-in-single-precision",
        "the film's sums are kept in float32",
        (
            Edit(
                "integrators/stages/film/film.py",
                "                store_row(plane, y, x, value)\n",
                "                store_row(plane, y, x, value)\n"
                "                for k in range(4):\n"
                "                    single = np.float32(load_one(plane, y, x + k))\n"
                "                    store_one(plane, y, x + k, np.float64(single))\n",
            ),
        ),
        scene="cornell-box",
        tests=("test_film.py::test_sums_are_double",),
        remark="it loses light from some million samples per pixel on",
    ),
    Mutation(
        "gamma-twice",
        "a PNG is encoded by the curve of sRGB twice",
        (
            Edit(
                "rendering/picture/image_files.py",
                "encoded = srgb_from_linear(np.where(broken[..., None], 0.0, pixels))",
                "encoded = srgb_from_linear(np.where(broken[..., None], 0.0, pixels))\n"
                "    encoded = srgb_from_linear(encoded)",
            ),
        ),
        scene="grey-furnace",
        tests=("test_image.py::test_png_is_the_nearest_srgb_level",),
        remark="pictures are compared as numbers, before they are files",
    ),
    Mutation(
        "exr-channels-reversed",
        "an EXR file holds B, G, R in the place of R, G, B",
        (
            Edit(
                "rendering/picture/image_files.py",
                'for c, name in enumerate("RGB")',
                'for c, name in enumerate("BGR")',
            ),
        ),
        scene="grey-furnace",
        tests=("test_image.py::test_exr_keeps_every_bit",),
        remark="pictures are compared as numbers, before they are files",
    ),
)
