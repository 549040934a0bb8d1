"""Defects of rough surfaces and plastics."""

from __future__ import annotations

from mitsuba_ref.mutations.mutation import Edit, Mutation

NUMBER_BY_NUMBER = (
    "test_bsdfs_against_mitsuba.py::test_eval_and_pdf",
    "test_bsdfs_against_mitsuba.py::test_sample",
)

DEFECTS = (
    Mutation(
        "roughness-squared",
        "alpha of a file is taken for the root of the roughness",
        (
            Edit(
                "plugins/bsdfs/rough/microfacets.py",
                "maximum(rough.alpha_u, _SMOOTHEST)",
                "maximum(rough.alpha_u * rough.alpha_u, _SMOOTHEST)",
            ),
        ),
        scene="rough-metal-and-glass",
        tests=NUMBER_BY_NUMBER,
    ),
    Mutation(
        "facets-shadowed-once",
        "what rough metal shows is not masked on its way out",
        (
            Edit(
                "plugins/bsdfs/rough/roughconductor.py",
                "unshadowed(facets, wo, h) * unshadowed(facets, wi, h)",
                "unshadowed(facets, wi, h)",
            ),
        ),
        scene="rough-metal-and-glass",
        tests=NUMBER_BY_NUMBER[:1],
    ),
    Mutation(
        "half-vector-not-bent",
        "the density of a refraction turns with the half vector of a reflection",
        (
            Edit(
                "plugins/bsdfs/rough/roughdielectric.py",
                "refracted = 1.0 / (bend * bend)",
                "refracted = 0.25 / (cos_i * cos_i)",
            ),
        ),
        scene="rough-metal-and-glass",
        tests=NUMBER_BY_NUMBER[:1],
    ),
    Mutation(
        "rough-glass-not-squeezed",
        "radiance that enters rough glass is not scaled by eta^2",
        (
            Edit(
                "plugins/bsdfs/rough/roughdielectric.py",
                "squeeze = 1.0 / (crossing * crossing)",
                "squeeze = 1.0",
            ),
        ),
        scene="rough-metal-and-glass",
        tests=NUMBER_BY_NUMBER[1:],
    ),
    Mutation(
        "plastic-always-linear",
        "colours do not deepen by what a coat throws back",
        (
            Edit(
                "plugins/bsdfs/smooth/plastic.py",
                "plastic.nonlinear != 0.0",
                "plastic.nonlinear > 1.0",
            ),
        ),
        scene="plastics",
        tests=NUMBER_BY_NUMBER,
    ),
    Mutation(
        "coat-seen-from-outside",
        "what a coat throws back is what it reflects from outside",
        (
            Edit(
                "plugins/bsdfs/smooth/plastic.py",
                "thrown_back = diffuse_fresnel(1.0 / eta)",
                "thrown_back = diffuse_fresnel(eta)",
            ),
        ),
        scene="plastics",
        tests=NUMBER_BY_NUMBER,
    ),
    Mutation(
        "coat-between-no-entries",
        "the table of a rough coat is not interpolated",
        (
            Edit(
                "plugins/bsdfs/rough/roughplastic.py",
                "* (x - below)",
                "* 0.0",
            ),
        ),
        scene="plastics",
        tests=NUMBER_BY_NUMBER,
    ),
    Mutation(
        "one-table-for-all",
        "every rough plastic looks at the table of the scene's first BSDF",
        (
            Edit(
                "plugins/bsdfs/parameters.py",
                "gather_row(table.first, 0, bsdf, bsdf >= 0)",
                "gather_row(table.first, 0, bsdf * 0, bsdf >= 0)",
            ),
        ),
        scene="plastics",
        tests=("test_bsdfs_against_mitsuba.py::test_several_tables_in_one_scene",),
    ),
    Mutation(
        "metal-by-schlick-of-white",
        "the colour of a principled metal fades with the angle twice as fast",
        (
            Edit(
                "plugins/bsdfs/rough/principled_lobes.py",
                "return square * square * rest",
                "return square * rest",
            ),
        ),
        scene="principled",
        tests=NUMBER_BY_NUMBER,
    ),
    Mutation(
        "refraction-takes-all-of-the-colour",
        "light takes on the base colour where it enters principled glass, and again",
        (
            Edit(
                "plugins/bsdfs/rough/principled.py",
                "root = vec3(sqrt(base.x), sqrt(base.y), sqrt(base.z))",
                "root = vec3(base.x, base.y, base.z)",
            ),
        ),
        scene="principled",
        tests=NUMBER_BY_NUMBER,
    ),
    Mutation(
        "coat-counted-by-half",
        "the density of principled surfaces knows half of the coat's samples",
        (
            Edit(
                "plugins/bsdfs/rough/principled.py",
                "normal_pdf(facets, wo, h) + coated * coat_pdf",
                "normal_pdf(facets, wo, h) + 0.5 * coated * coat_pdf",
            ),
        ),
        scene="principled",
        tests=(
            "test_bsdfs_against_mitsuba.py::test_eval_and_pdf",
            "test_bsdfs_against_mitsuba.py::test_directions_follow_the_density",
        ),
    ),
    Mutation(
        "sheets-bend-light",
        "the facets of light that goes through a thin sheet are those of its reflection",
        (
            Edit(
                "plugins/bsdfs/rough/principledthin.py",
                "ggx_facets(thin.roughness * (0.65 * thin.eta - 0.35), thin.anisotropic)",
                "ggx_facets(thin.roughness, thin.anisotropic)",
            ),
        ),
        scene="principledthin",
        tests=NUMBER_BY_NUMBER,
    ),
    Mutation(
        "sheets-let-half-through",
        "diffuse light passes a thin sheet twice as often as the file says",
        (
            Edit(
                "plugins/bsdfs/rough/principledthin.py",
                "rest, through = 1.0 - thin.spec_trans, 0.5 * thin.diff_trans",
                "rest, through = 1.0 - thin.spec_trans, thin.diff_trans",
            ),
        ),
        scene="principledthin",
        tests=NUMBER_BY_NUMBER[:1],
    ),
)
