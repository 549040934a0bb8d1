"""Defects of lights: which is sampled, with which density, and what it sends."""

from __future__ import annotations

from mitsuba_ref.mutations.mutation import Edit, Mutation

DEFECTS = (
    Mutation(
        "light-choice-probability",
        "a light is weighed as if there were one light more",
        (
            Edit(
                "plugins/lights/weights.py",
                "return np.float32(1.0 / max(1, lights.asked.size))",
                "return np.float32(1.0 / (lights.count + 1))",
            ),
        ),
        scene="analytic-shapes",
    ),
    Mutation(
        "last-light-never-sampled",
        "the choice among n lights is made among the first n - 1",
        (
            Edit(
                "plugins/sampling/numbers_and_warps.py",
                "splat_f32(np.float32(count - 1))",
                "splat_f32(np.float32(count - 2))",
            ),
        ),
        scene="analytic-shapes",
        tests=("test_lights.py::test_lights_are_chosen_evenly",),
    ),
    Mutation(
        "found-light-weighed-as-if-uniform",
        "a light that a path finds is weighed as if all were chosen equally often",
        (
            Edit(
                "plugins/lights/choice/choose.py",
                "store_where(rays.pdf, 0, i, density / chosen.probability, found)",
                "store_where(rays.pdf, 0, i, density * np.float32(choice.count), found)",
            ),
        ),
        scene="analytic-shapes",
        tests=(
            "test_light_choice.py::test_a_light_that_is_found_has_the_same_probability",
        ),
        remark="a replay chooses as Mitsuba does",
    ),
    Mutation(
        "probability-without-uniform-share",
        "the density of a chosen light leaves out that it may have been chosen uniformly",
        (
            Edit(
                "plugins/lights/choice/choose.py",
                "probability = one_of_all + (1.0 - uniform)",
                "probability = (1.0 - uniform)",
            ),
        ),
        scene="analytic-shapes",
        tests=("test_light_choice.py::test_lights_are_chosen_as_often_as_is_said",),
        remark="a replay chooses as Mitsuba does",
    ),
    Mutation(
        "area-density-not-by-solid-angle",
        "the density of a point on a light is 1 / A, without r^2 / cos",
        (
            Edit(
                "plugins/shapes/surface.py",
                "return distance * distance * inverse_area / cosine",
                "return inverse_area + 0.0 * cosine",
            ),
        ),
        scene="cornell-box",
        tests=("test_closed_forms.py::test_disk_light_on_its_axis",),
    ),
    Mutation(
        "light-shines-both-ways",
        "an area light sends light from its back too",
        (
            Edit(
                "plugins/lights/finite/area.py",
                "usable = (dot(wi, chosen.side) < 0.0) & (pdf > 0.0)",
                "usable = pdf > 0.0",
            ),
            Edit(
                "plugins/lights/finite/area.py",
                "shining = mine & "
                "(dot(load3(points.wo, i), load3(points.shading_normal, i)) > 0.0)",
                "shining = mine",
            ),
        ),
        scene="smooth-lamp",
        tests=("test_lights.py::test_a_light_seen_from_behind_gives_nothing",),
    ),
    Mutation(
        "light-samples-from-the-back",
        "light samples, not BSDF samples, find the back of an area light shining",
        (
            Edit(
                "plugins/lights/finite/area.py",
                "usable = (dot(wi, chosen.side) < 0.0) & (pdf > 0.0)",
                "usable = pdf > 0.0",
            ),
        ),
        scene="smooth-lamp",
        tests=("test_lights.py::test_a_light_seen_from_behind_gives_nothing",),
    ),
    Mutation(
        "sphere-density-by-projected-disk",
        "a sphere light counts as the solid angle pi sin^2 instead of 2 pi (1 - cos)",
        (
            Edit(
                "plugins/lights/finite/spheres.py",
                "select(outside, 1.0 / (TWO_PI * one_minus_cos), by_area)",
                "select(outside, 1.0 / (TWO_PI * 0.5 * one_minus_cos "
                "* (2.0 - one_minus_cos)), by_area)",
            ),
        ),
        scene="emitters",
        tests=("test_lights.py::test_sphere_light",),
    ),
    Mutation(
        "sky-density-of-half-a-sphere",
        "sky samples over the whole sphere are weighed as if over half of it",
        (
            Edit(
                "plugins/lights/infinite/constant.py",
                "_FOUR_PI = np.float32(4.0 * np.pi)",
                "_FOUR_PI = np.float32(2.0 * np.pi)",
            ),
        ),
        scene="grey-furnace",
        tests=("test_closed_forms.py::test_sky_over_a_convex_body",),
    ),
    Mutation(
        "spot-falloff-smooth",
        "a spot light fades by the square of Mitsuba's factor",
        (
            Edit(
                "plugins/lights/finite/spot.py",
                "splat_f32(1.0), fading",
                "splat_f32(1.0), fading * fading",
            ),
        ),
        scene="smooth-mesh",
        tests=("test_lights.py::test_spot_light",),
    ),
    Mutation(
        "spheres-cast-no-shadow",
        "shadow rays do not ask the spheres",
        (
            Edit(
                "rendering/tables/geometry.py",
                "        parting = lamps and",
                "        if accelerator is accelerators.by_kind.get('spheres'):\n"
                "            continue\n"
                "        parting = lamps and",
            ),
        ),
        scene="kaleidoscope",
    ),
    Mutation(
        "flat-casts-no-shadow",
        "shadow rays pass by all that is flat, as if it were a wall around the scene",
        (
            Edit(
                "accelerators/non_occluders.py",
                "is_flat & apart",
                "is_flat",
            ),
        ),
        scene="cornell-box",
        tests=("test_occluders.py::test_pictures_are_those_of_brute_force",),
    ),
    Mutation(
        "light-shades-itself",
        "shadow rays reach past the point of the light that they go to",
        (
            Edit(
                "integrators/stages/direct_light.py",
                "BEFORE_LIGHT = np.float32(1.0 - ",
                "BEFORE_LIGHT = np.float32(1.0 + ",
            ),
        ),
        scene="cornell-box",
        tests=("test_closed_forms.py::test_disk_light_on_its_axis",),
    ),
    Mutation(
        "light-samples-undivided",
        "several samples of the lights at a point are added instead of averaged",
        (
            Edit(
                "integrators/direct.py",
                "_points(scene, work, count, settings.light_samples)",
                "_points(scene, work, count, np.int64(1))",
            ),
        ),
        scene="many-samples",
        tests=(
            "test_direct_samples.py::test_the_variance_falls_with_the_number_of_samples",
        ),
    ),
    Mutation(
        "densities-without-their-numbers",
        "light samples are weighed as if there were as many of the BSDF",
        (
            Edit(
                "plugins/lights/weights.py",
                "power_heuristic(light_pdf * np.float32(settings.light_share), bsdf_pdf)",
                "power_heuristic(light_pdf, bsdf_pdf)",
            ),
        ),
        scene="many-samples",
    ),
    Mutation(
        "envmap-density-half-a-texel-off",
        "the density of a direction is looked up as if texels began where they are centred",
        (
            Edit(
                "plugins/lights/infinite/envmap.py",
                "shifted = u - half_texel(sky)",
                "shifted = u",
            ),
        ),
        scene="envmap",
        tests=("test_envmap.py::test_samples_follow_the_density",),
    ),
    Mutation(
        "envmap-density-of-less-than-one",
        "the density of directions to an environment map is 0.8 % too small",
        (
            Edit(
                "plugins/lights/infinite/envmap.py",
                "return density * (_BY_SOLID_ANGLE /",
                "return density * (np.float32(0.992) * _BY_SOLID_ANGLE /",
            ),
        ),
        scene="envmap",
    ),
    Mutation(
        "envmap-pi-of-four-digits",
        "the angle from the pole of an environment map is taken with 3.141 for pi",
        (
            Edit(
                "plugins/lights/infinite/envmap.py",
                "_PI = np.float32(np.pi)",
                "_PI = np.float32(3.141)",
            ),
        ),
        scene="envmap",
    ),
    Mutation(
        "sphere-light-crowded-at-its-middle",
        "the middle of the cone that a sphere light fills is chosen too often",
        (
            Edit(
                "plugins/lights/finite/spheres.py",
                "return x * one_minus_cos",
                "return x * x * one_minus_cos",
            ),
        ),
        scene="emitters",
    ),
    Mutation(
        "warp-cuts-columns-in-the-wrong-place",
        "what is left of a number after a choice is cut off a little too high",
        (
            Edit(
                "plugins/sampling/hierarchical_warp.py",
                "x = select(second, x - left, x)",
                "x = select(second, x - 0.99 * left, x)",
            ),
        ),
        scene="envmap",
        tests=("test_envmap.py::test_samples_follow_the_density",),
    ),
    Mutation(
        "texel-density-without-its-share",
        "a textured lamp is weighed as if its texels were all alike",
        (
            Edit(
                "plugins/lights/finite/textured_area.py",
                "pdf = pdf * distance * distance / (here.area * cosine)",
                "pdf = distance * distance / (here.area * cosine)",
            ),
        ),
        scene="textured_lights",
    ),
    Mutation(
        "projector-without-its-cosine",
        "a projector's picture does not grow darker away from the axis as it should",
        (
            Edit(
                "plugins/lights/finite/projector.py",
                "strength = strength * r * inverse * inverse * inverse",
                "strength = strength * inverse * inverse",
            ),
        ),
        scene="projector_and_spot",
        tests=("test_textured_lights.py::test_samples_are_mitsubas",),
    ),
)
