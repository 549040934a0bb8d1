"""The versions of Mitsuba that can be followed, and the numbers in which they differ.

Other files say what Mitsuba does without naming a version: it holds for all versions that
are listed here. What a further version needs, place by place, is in
docs/mitsuba-versions.md.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

_ULP = 2.0**-24  # of float32 below 1


class MitsubaRules(NamedTuple):
    """The numbers of one version."""

    version: str
    ray_epsilon: float  # new rays start this times 1 + max|p| off their surface
    shadow_epsilon: float  # shadow rays end this part of their length before the light
    llvm: range  # major versions of the LLVM with which `llvm_ad_rgb` works


# The oldest first. LLVM 15 ends the process ("Cannot select: fminimum"); 19 was run.
RULES = {
    rules.version: rules
    for rules in (
        MitsubaRules(
            version="3.9.1",
            ray_epsilon=1500 * _ULP,
            shadow_epsilon=15000 * _ULP,
            llvm=range(16, 20),
        ),
    )
}
NEWEST = list(RULES.values())[-1]
"""What is followed without a replay: the meaning of a file, and where shadow rays end."""


@functools.cache
def installed_version() -> str | None:
    """Return the version of the installed Mitsuba, which is not imported; None: none is."""
    from importlib import metadata  # only here: it takes longer to import than the rest

    try:
        return metadata.version("mitsuba")
    except metadata.PackageNotFoundError:
        return None


def followed_version() -> str:
    """Return the version that a replay follows: the installed one, else the newest here."""
    installed = installed_version()
    return installed if installed in RULES else NEWEST.version


def why_unknown(version: str) -> str:
    """Return one line about a version that is not listed here, and what can be done."""
    return (
        f"Mitsuba {version} is unknown; known: {', '.join(RULES)}; possible: "
        f"pip install mitsuba=={NEWEST.version}, or another entry in "
        "renderer/mitsuba_version.py (docs/mitsuba-versions.md)"
    )
