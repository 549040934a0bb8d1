"""Defects of what `moment` and `direct` do beside their colours' paths."""

from __future__ import annotations

from mitsuba_ref.mutations.mutation import Edit, Mutation

NO_CHANNELS = "a replay compares colours; the channels of `moment` have a test"

DEFECTS = (
    Mutation(
        "moments-of-columns",
        "the moments are those of colours times the transposed matrix of XYZ",
        (
            Edit(
                "integrators/moment.py",
                "shown.pixels @ XYZ_FROM_SRGB.T",
                "shown.pixels @ XYZ_FROM_SRGB",
            ),
        ),
        scene="moment",
        tests=("test_moment.py::test_every_channel_is_mitsubas",),
        remark=NO_CHANNELS,
    ),
    Mutation(
        "moments-one-channel-off",
        "second moments are taken from the channel before their own",
        (
            Edit(
                "integrators/moment.py",
                "start = kind.channels\n",
                "start = kind.channels - 1\n",
            ),
        ),
        scene="moment",
        tests=("test_moment.py::test_of_a_single_sample_they_are_its_square",),
        remark=NO_CHANNELS,
    ),
    Mutation(
        "moments-of-a-leaner-method",
        "moments are those of whatever method has the same mean",
        (
            Edit(
                "rendering/planning/make_plan.py",
                "not replay and asked.moments is None",
                "not replay",
            ),
        ),
        scene="moment",
        tests=("test_moment.py::test_no_leaner_method_stands_in_for_it",),
        remark="the mean is right, and a replay never takes another method",
    ),
    Mutation(
        "bsdf-samples-undivided",
        "several samples of the BSDF at a point are added instead of averaged",
        (
            Edit(
                "integrators/direct.py",
                "_points(scene, work, count, settings.bsdf_samples)",
                "_points(scene, work, count, np.int64(1))",
            ),
        ),
        scene="many-samples",
        tests=(
            "test_direct_samples.py::test_the_variance_falls_with_the_number_of_samples",
        ),
    ),
    Mutation(
        "one-bsdf-sample-less",
        "one of several samples of the BSDF is not followed",
        (
            Edit(
                "integrators/direct.py",
                "for number in range(settings.bsdf_samples):",
                "for number in range(1, settings.bsdf_samples):",
            ),
        ),
        scene="many-samples",
    ),
)
