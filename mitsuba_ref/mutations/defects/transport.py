"""Defects of the rendering equation's estimator: cosines, weights, roulette, depth."""

from __future__ import annotations

from mitsuba_ref.mutations.mutation import Edit, Mutation

DEFECTS = (
    Mutation(
        "cosine-dropped",
        "a diffuse surface does not weigh incident light by its cosine",
        (
            Edit(
                "plugins/bsdfs/smooth/diffuse.py",
                "return diffuse.reflectance * (INV_PI * cos_i), INV_PI * cos_i",
                "one = select(wi.z > 0.0, cos_i * 0.0 + 1.0, 0.0)\n"
                "    return diffuse.reflectance * (INV_PI * one), INV_PI * cos_i",
            ),
        ),
        scene="appel-teapot",
        tests=(
            "test_closed_forms.py::test_point_light_over_a_plane_falls_off_as_lambert_says",
        ),
    ),
    Mutation(
        "inverse-pi-dropped",
        "the diffuse BRDF is k_d instead of k_d / pi",
        (
            Edit(
                "plugins/bsdfs/smooth/diffuse.py",
                "return diffuse.reflectance * (INV_PI * cos_i), ",
                "return diffuse.reflectance * cos_i, ",
            ),
        ),
        scene="appel-teapot",
        tests=(
            "test_closed_forms.py::test_point_light_over_a_plane_falls_off_as_lambert_says",
        ),
    ),
    Mutation(
        "emission-counted-twice",
        "light found by a BSDF sample is added in full, light samples as well",
        (
            Edit(
                "plugins/lights/weights.py",
                "weight = power_heuristic(pdf, light_pdf *",
                "weight = 1.0 + 0.0 * (pdf + light_pdf *",
            ),
        ),
        scene="cornell-box",
        tests=("test_closed_forms.py::test_disk_light_on_its_axis",),
    ),
    Mutation(
        "mis-weights-swapped",
        "each of two samples gets the weight that belongs to the other one",
        (
            Edit(
                "plugins/sampling/numbers_and_warps.py",
                "ratio = other_pdf / pdf",
                "ratio = pdf / other_pdf",
            ),
        ),
        scene="cornell-box",
        tests=("test_sampling.py::test_power_heuristic",),
        remark="the weights still add up to one: more noise, no bias",
    ),
    Mutation(
        "mirrors-lose-the-lamp",
        "a path that no light sample could have found is weighed as if one had",
        (
            Edit(
                "plugins/lights/weights.py",
                "return select(pdf > 0.0, weight, 1.0)",
                "return weight",
            ),
        ),
        scene="caustic",
        tests=("test_closed_forms.py::test_a_pixel_on_a_light_shows_its_radiance",),
    ),
    Mutation(
        "mis-weight-without-choice",
        "the weight of a BSDF sample forgets that one light of several is sampled",
        (
            Edit(
                "plugins/lights/finite/area.py",
                "settings, load_row(points.pdf, 0, i), light_pdf * probability",
                "settings, load_row(points.pdf, 0, i), light_pdf",
            ),
        ),
        scene="analytic-shapes",
    ),
    Mutation(
        "roulette-not-reweighted",
        "paths that survive roulette are not weighed up by 1 / q",
        (
            Edit(
                "integrators/stages/scatter.py",
                "alive & (number < survival), throughput / survival",
                "alive & (number < survival), throughput",
            ),
        ),
        scene="cornell-box",
        tests=("test_furnaces.py::test_russian_roulette_keeps_the_furnace_at_its_limit",),
    ),
    Mutation(
        "roulette-without-eta",
        "the survival probability does not undo the eta^2 of the glass around",
        (
            Edit(
                "integrators/stages/scatter.py",
                "minimum(largest(throughput) * eta * eta, ",
                "minimum(largest(throughput), ",
            ),
        ),
        scene="lamp-in-glass",
        remark="any survival probability is right on average: more noise, no bias",
    ),
    Mutation(
        "roulette-one-bounce-early",
        "roulette begins one bounce before rr_depth",
        (
            Edit(
                "integrators/stages/scatter.py",
                "if depth < settings.roulette_depth:",
                "if depth + 1 < settings.roulette_depth:",
            ),
        ),
        scene="cornell-box",
        remark="any survival probability is right on average: more noise, no bias",
    ),
    Mutation(
        "depth-one-more",
        "paths are one bounce longer than max_depth",
        (
            Edit(
                "integrators/path.py",
                "last = bounce + 1 >= settings.max_depth",
                "last = bounce >= settings.max_depth",
            ),
        ),
        scene="cropped-film",
        tests=("test_furnaces.py::test_furnace_of_finite_depth_is_a_partial_sum",),
    ),
    Mutation(
        "hemisphere-without-cosine",
        "diffuse directions are not spread by the cosine, which their weight supposes",
        (
            Edit(
                "plugins/sampling/numbers_and_warps.py",
                "return vec3(p, q, sqrt(maximum(z2, splat_f32(0.0))))",
                "z = maximum(z2, splat_f32(0.0))\n"
                "    s = sqrt(1.0 + z)\n"
                "    return vec3(p * s, q * s, z)",
            ),
        ),
        scene="grey-furnace",
        tests=("test_sampling.py::test_the_hemisphere_has_density_cos_over_pi",),
        remark="a replay goes by Mitsuba's own warp",
    ),
    Mutation(
        "correlated-seeds",
        "the seed does not reach the random numbers: every seed draws the same",
        (
            Edit(
                "plugins/sampling/numbers_and_warps.py",
                "_block_bits(block),\n        splat_u32(np.uint32(seed)),",
                "_block_bits(block),\n        splat_u32(np.uint32(0)),",
            ),
        ),
        scene="cornell-box",
        tests=("test_sampling.py::test_neighbours_are_independent",),
        remark="one picture alone cannot show it; a replay draws Mitsuba's numbers",
    ),
    Mutation(
        "nets-in-one-order",
        "the sampler sobol takes the points of all groups in the order of the index",
        (
            Edit(
                "plugins/sampling/sobol.py",
                "    index = bit_reverse(scramble(bit_reverse(index), order))\n",
                "    index = key.later + np.uint32(sample)\n",
            ),
        ),
        scene="cornell-box",
        tests=("test_sampler_patterns.py::test_film_and_first_light_are_one_pattern",),
        remark="no scene asks for sobol; no bias, but noise",
    ),
    Mutation(
        "together-alike",
        "the samples of a pixel that are traced together draw the same numbers",
        (
            Edit(
                "kernels/records/tile.py",
                "return SampleKey(as_u32(pixel), as_u32(later))",
                "return SampleKey(as_u32(pixel), as_u32(later * 0))",
            ),
        ),
        scene="cornell-box",
        tests=("test_samples_together.py::test_no_bit_depends_on_who_goes_together",),
        remark="no bias, but noise; a replay traces one sample at a time",
    ),
    Mutation(
        "digits-flipped-by-weak-bits",
        "the sampler sobol flips the first digits by the lowest bits of a product",
        (Edit("plugins/sampling/sobol.py", "    key ^= key >> 16\n", ""),),
        scene="cornell-box",
        tests=("test_sampling.py::test_estimates_over_two_blocks_have_no_bias",),
        remark="no scene asks for sobol",
    ),
    Mutation(
        "correlated-pixels",
        "all pixels of a column draw the same random numbers",
        (
            Edit(
                "kernels/records/tile.py",
                "pixel = row * tile.film_width + (x >> tile.level) + tile.x",
                "pixel = row * 0 + (x >> tile.level) + tile.x",
            ),
        ),
        scene="cornell-box",
    ),
)
