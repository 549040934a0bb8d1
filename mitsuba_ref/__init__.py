"""The same scene file in Mitsuba 3, and how far apart the two pictures are.

The only package that imports mitsuba or drjit. Its rooms, from the ground up; imports go
down, which a contract in pyproject.toml keeps:

- `records`: the requests to both renderers, and the records of their results;
- `our_renderer`: our side of a comparison;
- `reference`: the file in Mitsuba's `scalar_rgb`, in a separate process, and the cache;
- `metrics`, `statistics`: how far apart pictures are, and whether that is more than noise;
- `diagnosis`: a verdict on any picture, and the mistake in it (`renderer_compare`);
- `ladder` (many pictures of each renderer), `replay` (the same random numbers on both
  sides; one path in both), `speed` (against accuracy, and Mitsuba by the clock);
- `command`: all of this for each scene, a table and a verdict;
- `generate`: scenes at random, judged by a replay, and the smallest that differ;
- `mutations`, `false_alarms`, `expected_failures`: what the checks see, how often they are
  wrong, and what is known to disagree.
"""

from mitsuba_ref.missing_packages import prepare_command_process

prepare_command_process()


def __getattr__(name: str) -> object:
    """Import `renderer_compare` when it is first used: it loads SciPy and Numba."""
    if name == "renderer_compare":
        from mitsuba_ref.diagnosis.comparison import renderer_compare

        return renderer_compare
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
