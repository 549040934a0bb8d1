"""The circumstances of a measurement: machine, versions, commit."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import shlex
import subprocess
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from mitsuba_ref.records.other_programs import KEY, cores_of_other_programs

DISTRIBUTIONS = (
    "lightproof",
    "numba",
    "llvmlite",
    "numpy",
    "mitsuba",
    "drjit",
    "scikit-image",
    "flip-evaluator",
    "colour-science",
    "embreex",
)


def circumstances(module: str, words: Sequence[str]) -> dict[str, Any]:
    """Return what every record says first: when, by which command, where, with what.

    Call it when all is measured: it says how busy the machine was meanwhile.

    Parameters
    ----------
    module, words
        Of the command `python -m module words...`.
    """
    return {
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": shlex.join(["python", "-m", module, *words]),
        "machine": describe_machine(),
        "versions": installed_versions(),
        "commit": current_commit(),
    }


def describe_machine() -> dict[str, Any]:
    """Return processor, usable cores, memory and system; no name of the machine.

    It also says how busy other programs kept it so far, so call it after measuring.
    """
    return {
        "cpu": _cpu_name(),
        "cores": usable_cores(),
        "memory_gib": _memory_gib(),
        "os": f"{platform.system()} {platform.release()} {platform.machine()}",
        KEY: cores_of_other_programs(),
    }


def usable_cores() -> int:
    """Return the cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def installed_versions() -> dict[str, str]:
    """Return the version of Python and of each library that decides a number."""
    versions = {"python": platform.python_version()}
    for name in DISTRIBUTIONS:
        try:
            versions[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            versions[name] = "not installed"
    return versions


def current_commit() -> str:
    """Return this work tree's commit, with "-dirty" if it differs, or "unknown".

    Records that were measured and not committed so far are no difference.
    """
    root = Path(__file__).resolve().parents[2]
    if not (root / ".git").exists():
        return "unknown"
    commit = _git(root, "rev-parse", "--short=12", "HEAD")
    changes = _git(root, "status", "--porcelain", "--", ".", ":!reports/measured")
    if not commit or changes is None:
        return "unknown"
    return f"{commit}-dirty" if changes else commit


def _git(root: Path, *arguments: str) -> str | None:
    try:
        run = subprocess.run(
            ["git", *arguments], cwd=root, capture_output=True, text=True, timeout=20
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return run.stdout.strip() if run.returncode == 0 else None


def _cpu_name() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def _memory_gib() -> float | None:
    try:
        pages, size = os.sysconf("SC_PHYS_PAGES"), os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return None
    return round(pages * size / 2**30, 1)
