"""The version, and the names that options take."""

from __future__ import annotations

# ------------------------------------------------------------------------------ version
# The version of this program, as files and checkpoints name it.

VERSION = "0.2.0"


# -------------------------------------------------------------------------------- names
# The names that the command line and `render` take, without what stands behind them.
#
# That is Numba and the kernels, which `--help` should not have to wait for.

INTEGRATORS = ("auto", "direct", "whitted", "path", "volpath", "depth", "aov", "work")
SAMPLERS = ("independent", "stratified", "multijitter", "orthogonal", "ldsampler", "sobol")
REPLAY = "mitsuba"  # the file's sampler, number by number as Mitsuba's scalar variants draw
LIGHT_CHOICES = ("importance", "uniform")
RAY_OFFSETS = ("tight", "mitsuba")
TEV = "127.0.0.1:14158"  # where the picture viewer tev listens
ACCELERATORS = (
    "auto",
    "brute",
    "boxes",
    "bvh",
    "bvh-median",
    "bvh-middle",
    "wide",
    "bsp",
    "grid",
    "grid-without-mailboxes",
    "grid-nested",
    "grid-clusters",
    "kd-middle",
    "kd-median",
    "kd-sah",
    "octree",
)
