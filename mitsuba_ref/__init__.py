"""The same scene file in Mitsuba 3, and how far apart the two pictures are.

The only package that imports mitsuba or drjit, and only below `variant`:
`variant -> edited_scene -> whitted, reference -> cache, worker` renders the file in
`scalar_rgb`, in a process of its own (`mitsuba_process`); `metrics, edges, noise ->
with_noise, without_noise, aov_comparison -> comparison` judge two sets of arrays without
knowing where they came from, once `obstacles` has found nothing against it; `validation`
does both for one scene, and `verdicts` lists what can come out.

Three more ways to look: `replay` (the same random numbers on both sides) with
`traced_pair` (one path in both); `statistics -> noisy_rungs, still_rungs ->
ladder_of_tests` (many seeds); `mutations` and `expected_failures` (what the checks see,
and what is known to disagree).
"""
