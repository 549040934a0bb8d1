"""Mitsuba itself: imported and set up in one place, for all modules of this folder."""

from __future__ import annotations

import functools
import importlib.metadata
import os
from typing import Any

from mitsuba_ref.records.request import MIN_THREADS
from renderer.errors import SceneError
from renderer.mitsuba_version import RULES, installed_version, why_unknown

VARIANT = "scalar_rgb"


@functools.cache
def load_mitsuba() -> Any:
    """Return mitsuba in `scalar_rgb`, quiet, with `whitted` and `merl` registered.

    Raises
    ------
    SceneError
        As `check_version`.
    """
    check_version()
    import drjit
    import mitsuba

    mitsuba.set_variant(VARIANT)
    mitsuba.set_log_level(mitsuba.LogLevel.Error)
    drjit.set_thread_count(max(MIN_THREADS, os.cpu_count() or 1))

    from mitsuba_ref.reference.plugins.hair import register_hair
    from mitsuba_ref.reference.plugins.merl import register_merl
    from mitsuba_ref.reference.plugins.whitted import register_whitted

    register_whitted(mitsuba)
    register_merl(mitsuba)
    register_hair(mitsuba)
    return mitsuba


def set_threads(threads: int | None) -> int:
    """Set Mitsuba's number of worker threads, at least two; return what was set.

    Parameters
    ----------
    threads
        Wanted workers; None is one for each core.
    """
    load_mitsuba()
    import drjit

    count = max(MIN_THREADS, threads or os.cpu_count() or 1)
    drjit.set_thread_count(count)
    return count


def check_version() -> None:
    """Refuse an installed Mitsuba that no entry of `RULES` is about.

    Raises
    ------
    SceneError
        Which versions are known, and what can be done.
    """
    version = installed_version()
    if version is not None and version not in RULES:
        raise SceneError(why_unknown(version))


def drjit_version() -> str:
    """Return the installed version of Dr.Jit, whose arithmetic Mitsuba uses."""
    return importlib.metadata.version("drjit")
