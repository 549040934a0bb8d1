"""Defects of textures."""

from __future__ import annotations

from mitsuba_ref.mutations.mutation import Edit, Mutation

DEFECTS = (
    Mutation(
        "number-of-a-board-not-swapped",
        "a checkerboard that gives a number has its fields where a colour's are",
        (
            Edit(
                "plugins/textures/nested.py",
                "select(same, second, first) if swapped",
                "select(same, first, second) if swapped",
            ),
            Edit(
                "plugins/textures/checkerboard.py",
                "return select(in_same_half(point.u, point.v), second, first)",
                "return select(in_same_half(point.u, point.v), first, second)",
            ),
        ),
        scene="textures",
        tests=(
            "test_textures.py::test_against_mitsuba",
            "test_textures.py::test_boards_of_boards",
        ),
    ),
    Mutation(
        "mean-instead-of-luminance",
        "a bitmap that gives a number gives the mean of its three",
        (
            Edit(
                "plugins/textures/texels.py",
                "return x.x * _R + x.y * _G + x.z * _B",
                "return (x.x + x.y + x.z) * np.float32(1.0 / 3.0)",
            ),
        ),
        scene="textures",
        tests=("test_textures.py::test_every_format_against_mitsuba",),
    ),
    Mutation(
        "half-floats-cut",
        "a half float loses the last two bits of its ten",
        (
            Edit(
                "plugins/textures/texels.py",
                "(half & 0x7FFF) << 13",
                "(half & 0x7FFC) << 13",
            ),
        ),
        scene="textures",
        tests=("test_textures.py::test_every_format_against_mitsuba",),
    ),
    Mutation(
        "mirror-repeats-its-edge-not",
        "a mirrored image runs backwards from the last texel but one",
        (
            Edit(
                "plugins/textures/bitmap.py",
                "select(odd, n - 1.0 - repeated, repeated)",
                "select(odd, n - repeated, repeated)",
            ),
        ),
        scene="textures",
        tests=("test_textures.py::test_against_mitsuba",),
    ),
    Mutation(
        "attribute-of-the-wrong-corner",
        "the second and the third vertex of a face change their attributes",
        (
            Edit(
                "plugins/textures/mesh_attribute.py",
                "gather_rows3(attributes.values, 3, column, mask) * u",
                "gather_rows3(attributes.values, 3, column, mask) * v",
            ),
            Edit(
                "plugins/textures/mesh_attribute.py",
                "gather_rows3(attributes.values, 6, column, mask) * v",
                "gather_rows3(attributes.values, 6, column, mask) * u",
            ),
        ),
        scene="textures",
        tests=("test_mesh_attributes.py::test_against_mitsuba",),
    ),
    Mutation(
        "attribute-not-scaled",
        "the scale of an attribute has no effect",
        (
            Edit(
                "plugins/textures/mesh_attribute.py",
                "return color * gather_row(attributes.scale, 0, texture, mask)",
                "return color",
            ),
        ),
        scene="textures",
        tests=("test_mesh_attributes.py::test_against_mitsuba",),
    ),
)
