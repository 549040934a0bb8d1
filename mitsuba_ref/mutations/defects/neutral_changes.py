"""Changes that alter no picture but in its last bits: no check may see them."""

from __future__ import annotations

from mitsuba_ref.mutations.mutation import Edit, Mutation

NEUTRAL_CHANGES = (
    Mutation(
        "worse-surface-area-heuristic",
        "visiting a node counts forty times as much: fewer splits, larger leaves",
        (
            Edit(
                "accelerators/bvh/bvh_tree.py",
                "TRAVERSAL_COST = 1.0",
                "TRAVERSAL_COST = 40.0",
            ),
        ),
        scene="instances",
        harmful=False,
    ),
    Mutation(
        "uneven-median",
        "the split at the median leaves a quarter on one side",
        (
            Edit(
                "accelerators/bvh/bvh_split.py",
                "middle = first + size // 2",
                "middle = first + (size + 3) // 4",
            ),
        ),
        scene="appel-teapot",
        harmful=False,
    ),
    Mutation(
        "smaller-leaves",
        "leaves of the hierarchy hold at most 3 primitives instead of 8",
        (
            Edit(
                "accelerators/bvh/bvh_build.py",
                "lower: ArrayLike, upper: ArrayLike, leaf_size: int = 8",
                "lower: ArrayLike, upper: ArrayLike, leaf_size: int = 3",
            ),
        ),
        scene="appel-teapot",
        harmful=False,
    ),
    Mutation(
        "tiles-in-reverse",
        "tiles are traced and added from the last to the first",
        (
            Edit(
                "rendering/tile_sources.py",
                "turn, place = divmod(number, places)",
                "turn, place = divmod(number, places)\n"
                "            tiles = film.work.tiles\n"
                "            place += tiles - 1 - 2 * (place % tiles)",
            ),
            Edit(
                "rendering/job.py",
                "first, end = film.strips[strip]",
                "strip = len(film.strips) - 1 - strip\n"
                "        first, end = film.strips[strip]",
            ),
        ),
        scene="cornell-box",
        harmful=False,
    ),
    Mutation(
        "shorter-jobs",
        "a tile's samples are summed in parts of 4 instead of 16",
        (Edit("rendering/film/work.py", "SAMPLES_PER_JOB = 16", "SAMPLES_PER_JOB = 4"),),
        scene="cornell-box",
        harmful=False,
    ),
    Mutation(
        "power-heuristic-by-squares",
        "the weight is p^2 / (p^2 + q^2), not 1 / (1 + (q / p)^2)",
        (
            Edit(
                "plugins/sampling/numbers_and_warps.py",
                "return 1.0 / (1.0 + ratio * ratio)",
                "square = pdf * pdf\n    return square / (square + other_pdf * other_pdf)",
            ),
        ),
        scene="cornell-box",
        harmful=False,
    ),
    Mutation(
        "other-random-numbers",
        "our own random numbers are others, as good as these",
        (
            Edit(
                "plugins/sampling/numbers_and_warps.py",
                "    a = a * 1664525 + 1013904223\n",
                "    a = a * 1664525 + 1013904227\n",
            ),
        ),
        scene="cornell-box",
        harmful=False,
    ),
)
