"""Defects of BSDFs and textures."""

from __future__ import annotations

from mitsuba_ref.mutations.mutation import Edit, Mutation

SCHLICK = """outer = (crossing - 1.0) / (crossing + 1.0)
    slanted = 1.0 - select(crossing < 1.0, far, near)
    square = slanted * slanted
    reflectance = outer * outer + (1.0 - outer * outer) * square * square * slanted"""

DEFECTS = (
    Mutation(
        "indices-swapped",
        "the indices of refraction of inside and outside change places",
        (
            Edit(
                "plugins/bsdfs/smooth/fresnel.py",
                "crossing = select(outside, eta, 1.0 / eta)",
                "crossing = select(outside, 1.0 / eta, eta)",
            ),
        ),
        scene="whitted-spheres",
        tests=("test_bsdfs.py::test_glass_from_outside",),
    ),
    Mutation(
        "schlick-instead-of-fresnel",
        "glass reflects by Schlick's approximation",
        (
            Edit(
                "plugins/bsdfs/smooth/fresnel.py",
                "reflectance = 0.5 * (perpendicular * perpendicular + parallel * parallel)",
                SCHLICK,
            ),
        ),
        scene="whitted-spheres",
        tests=("test_fresnel_series.py::test_glass_reflects_as_fresnel_says",),
    ),
    Mutation(
        "schlick-in-a-noisy-scene",
        "the same approximation, seen through the noise of a path tracer",
        (
            Edit(
                "plugins/bsdfs/smooth/fresnel.py",
                "reflectance = 0.5 * (perpendicular * perpendicular + parallel * parallel)",
                SCHLICK,
            ),
        ),
        scene="caustic",
    ),
    Mutation(
        "eta-squared-dropped",
        "radiance that enters glass is not scaled by eta^2",
        (
            Edit(
                "plugins/bsdfs/smooth/dielectric.py",
                "squeeze = 1.0 / (crossing * crossing)",
                "squeeze = 1.0",
            ),
        ),
        scene="lamp-in-glass",
    ),
    Mutation(
        "total-reflection-lost",
        "beyond the critical angle glass lets light through",
        (
            Edit(
                "plugins/bsdfs/smooth/fresnel.py",
                "select(total & (crossing != 1.0), splat_f32(1.0), reflectance)",
                "select(total & (crossing != 1.0), splat_f32(0.0), reflectance)",
            ),
        ),
        scene="lamp-in-glass",
        tests=("test_bsdfs.py::test_total_internal_reflection",),
    ),
    Mutation(
        "absorption-ignored",
        "the imaginary part k of a metal's index counts as a tenth less",
        (
            Edit("plugins/bsdfs/smooth/conductor.py", "metal.k.x)", "metal.k.x * 0.9)"),
            Edit("plugins/bsdfs/smooth/conductor.py", "metal.k.y)", "metal.k.y * 0.9)"),
            Edit("plugins/bsdfs/smooth/conductor.py", "metal.k.z)", "metal.k.z * 0.9)"),
        ),
        scene="metals",
    ),
    Mutation(
        "specular-colour-ignored",
        "specular_reflectance of a metal has no effect",
        (
            Edit(
                "plugins/bsdfs/smooth/conductor.py",
                "return metal.specular_reflectance * fresnel",
                "return fresnel",
            ),
        ),
        scene="kaleidoscope",
    ),
    Mutation(
        "one-sided-surfaces-show-both-sides",
        "the back of a one-sided surface looks like its front",
        (
            Edit(
                "integrators/stages/surface/shading_frame.py",
                "bsdf = select(front, ahead, behind)",
                "bsdf = select(front, ahead, ahead)",
            ),
        ),
        scene="smooth-lamp",
    ),
    Mutation(
        "texture-mirror-wrap",
        "a mirrored texture repeats one texel off at each period",
        (
            Edit(
                "plugins/textures/bitmap.py",
                "mirrored = select(odd, n - 1.0 - repeated, repeated)",
                "mirrored = select(odd, n - repeated, repeated)",
            ),
        ),
        scene="textured-room",
        tests=("test_textures.py::test_against_mitsuba",),
    ),
    Mutation(
        "texture-half-a-texel",
        "bilinear filtering takes the corner of a texel for its centre",
        (
            Edit(
                "plugins/textures/bitmap.py",
                "half = select(nearest, splat_f32(0.0), splat_f32(0.5))",
                "half = select(nearest, splat_f32(0.0), splat_f32(0.0))",
            ),
        ),
        scene="textured-room",
        tests=("test_textures.py::test_against_mitsuba",),
    ),
    Mutation(
        "texture-upside-down",
        "row 0 of an image is at v = 0",
        (
            Edit(
                "plugins/textures/bitmap.py",
                "y = (1.0 - point.v) * to_f32(height) - half",
                "y = point.v * to_f32(height) - half",
            ),
        ),
        scene="textured-room",
        tests=("test_textures.py::test_a_bitmap_by_hand",),
    ),
    Mutation(
        "texture-not-linear",
        "8-bit texels are taken as they are instead of decoded from sRGB",
        (
            Edit(
                "plugins/textures/texels.py",
                "decoded = decoded_bytes(srgb)",
                "decoded = decoded_bytes(False)",
            ),
        ),
        scene="textured-room",
        tests=("test_scene_file_textures.py::test_texels_are_those_of_mitsuba",),
    ),
    Mutation(
        "half-angle-spaced-evenly",
        "the cells of a measured material are taken for equally wide",
        (
            Edit(
                "plugins/bsdfs/merl.py",
                "return sqrt(theta / _HALF_PI)",
                "return theta / _HALF_PI",
            ),
        ),
        scene="measured-ball",
        tests=("test_merl.py::test_a_known_brdf_comes_back",),
    ),
    Mutation(
        "difference-angle-not-reciprocal",
        "phi_d of a measured material is not folded into half a turn",
        (
            Edit(
                "plugins/bsdfs/merl.py",
                "select(turned < 0.0, turned + 1.0, turned)",
                "fabs(turned)",
            ),
            Edit("plugins/bsdfs/merl.py", "    floor,\n", "    fabs,\n    floor,\n"),
        ),
        scene="measured-ball",
        tests=("test_merl.py::test_a_known_brdf_comes_back",),
    ),
    Mutation(
        "measured-density-of-half-vectors",
        "the density of a measured material's samples is that of half vectors",
        (
            Edit(
                "plugins/bsdfs/merl.py",
                "_half_vector_pdf(table, h) / (4.0 * dot(wo, h))",
                "_half_vector_pdf(table, h)",
            ),
        ),
        scene="measured-ball",
        tests=("test_merl.py::test_half_vectors_come_as_often_as_the_density_says",),
    ),
)
