"""Defects of BSDFs that hold others, and of those that light goes straight through."""

from __future__ import annotations

from mitsuba_ref.mutations.mutation import Edit, Mutation

NUMBER_BY_NUMBER = ("test_nested_bsdfs.py::test_the_same_numbers_as_mitsuba",)


def _mutation(name: str, does: str, *edits: Edit, scene: str = "nested-bsdfs") -> Mutation:
    return Mutation(name, does, edits, scene=scene, tests=NUMBER_BY_NUMBER)


DEFECTS = (
    _mutation(
        "mask-choice-used-twice",
        "what is masked is given the number that chose it, not what is left of it",
        Edit(
            "plugins/bsdfs/wrappers/mask.py",
            "select(met, choice / opacity, choice)",
            "choice",
        ),
        Edit(
            "plugins/bsdfs/wrappers/mask.py",
            "chosen.pdf * opacity, 1.0 - opacity",
            "chosen.pdf, 1.0 - opacity",
        ),
    ),
    _mutation(
        "mask-forgets-its-share",
        "lights are reflected by a mask as if it had no holes",
        Edit(
            "plugins/bsdfs/wrappers/mask.py",
            "return f_cos * opacity, pdf * opacity",
            "return f_cos, pdf",
        ),
    ),
    _mutation(
        "blend-weight-of-the-first",
        "the weight of a blend is the share of the first BSDF",
        Edit(
            "plugins/bsdfs/wrappers/blend.py",
            "f_a * (1.0 - w) + f_b * w, pdf_a * (1.0 - w) + pdf_b * w",
            "f_a * w + f_b * (1.0 - w), pdf_a * w + pdf_b * (1.0 - w)",
        ),
    ),
    _mutation(
        "blend-of-one-density",
        "the density of a blend's sample is that of the BSDF that was chosen alone",
        Edit(
            "plugins/bsdfs/wrappers/blend.py",
            "pdf = select(second, pdf_a, a.pdf) * other + select(second, b.pdf, pdf_b) * w",
            "pdf = select(second, b.pdf * w, a.pdf * other)",
        ),
    ),
    _mutation(
        "normal-map-not-centred",
        "the colours of a normal map are taken for normals as they are",
        Edit("plugins/bsdfs/wrappers/normalmap.py", "rgb.x * 2.0 - 1.0", "rgb.x"),
    ),
    _mutation(
        "normal-map-without-shadows",
        "light does not fade out where a turned surface ends",
        Edit(
            "plugins/bsdfs/wrappers/normalmap.py",
            "f_cos = f_cos * _shadowing(turned, frame.n, wi)",
            "f_cos = f_cos * 1.0",
        ),
    ),
    _mutation(
        "pane-of-one-surface",
        "a pane reflects as one of its surfaces does",
        Edit("plugins/bsdfs/smooth/thindielectric.py", "once * 2.0 / (1.0 + once)", "once"),
    ),
    _mutation(
        "back-not-turned",
        "the light that a two-sided nesting sees from behind is not mirrored with it",
        Edit(
            "plugins/bsdfs/wrappers/twosided.py",
            "turned = vec3(wi.x, wi.y, select(wo.z > 0.0, wi.z, -wi.z))",
            "turned = wi",
        ),
    ),
    Mutation(
        "bumps-turned",
        "the slopes of a bump map along u and v change places",
        (
            Edit(
                "plugins/bsdfs/wrappers/bumpmap.py",
                "by_u, by_v = bumped.height[0] * bumped.scale, "
                "bumped.height[1] * bumped.scale",
                "by_u, by_v = bumped.height[1] * bumped.scale, "
                "bumped.height[0] * bumped.scale",
            ),
        ),
        scene="bumps",
        tests=("test_plugin_scenes.py::test_a_plugin_takes_mitsubas_paths",),
    ),
    Mutation(
        "bump-slope-of-one-texel",
        "the slope of a bump map does not grow with the size of the image",
        (
            Edit(
                "plugins/textures/gradient.py",
                "(m_uu * x + m_vu * y) * width",
                "(m_uu * x + m_vu * y)",
            ),
        ),
        scene="bumps",
        tests=("test_plugin_scenes.py::test_a_plugin_takes_mitsubas_paths",),
    ),
    Mutation(
        "holes-are-surfaces",
        "who has gone through the hole of a mask counts as one that met a surface",
        (
            Edit(
                "plugins/bsdfs/wrappers/mask.py",
                "select(met, chosen.lobe, splat_i32(STRAIGHT))",
                "select(met, chosen.lobe, splat_i32(1))",
            ),
        ),
        scene="no_sky",
    ),
    Mutation(
        "null-is-a-surface",
        "who has gone through `null` counts as one that met a surface",
        (
            Edit(
                "plugins/bsdfs/smooth/null.py",
                "one, one, splat_i32(STRAIGHT))",
                "one, one, splat_i32(1))",
            ),
        ),
        scene="no_sky",
    ),
    Mutation(
        "matched-glass-is-a-hole",
        "glass in a medium of its own index counts as a hole, as light goes straight on",
        (
            Edit(
                "plugins/bsdfs/smooth/dielectric.py",
                "splat_i32(DELTA))",
                "select(reflected | (crossing != 1.0), splat_i32(DELTA), 2))",
            ),
        ),
        scene="no_sky",
    ),
    Mutation(
        "once-through-a-hole-always",
        "a path that has left a surface is taken for one that has met holes alone",
        (
            Edit(
                "integrators/stages/straight_through.py",
                "if rays.lobe[k] != STRAIGHT:",
                "if rays.lobe[k] == STRAIGHT:\n"
                "            rays.met[rays.slot[k]] |= HOLES_ALONE\n"
                "        else:",
            ),
        ),
        scene="no_sky",
    ),
    Mutation(
        "holes-play-no-roulette",
        "a path through a hole always survives roulette, and is raised all the same",
        (
            Edit(
                "integrators/stages/scatter.py",
                "settings, bounce + 1, throughput, eta, load_row(numbers, 3, i), alive",
                "settings,\n"
                "            bounce + 1,\n"
                "            throughput,\n"
                "            eta,\n"
                "            select(lobe_of(chosen) == np.int32(2), "
                "splat_f32(0.0), load_row(numbers, 3, i)),\n"
                "            alive,",
            ),
        ),
        scene="mask",
    ),
)
