"""A Mitsuba variant in a separate process, which stays alive between its turns.

A measurement lets renderers take turns. Variants exclude one another in one process, and
`llvm_ad_rgb` ends the process where it finds an LLVM that it cannot use.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mitsuba_ref.records.request import TIME_LIMIT
from mitsuba_ref.reference.errors import MitsubaError
from mitsuba_ref.reference.json_process import Answerer, JsonProcess, answer_requests
from renderer.mitsuba_version import RULES, followed_version

__all__ = ["Answerer", "VariantProcess", "answer_requests", "find_llvm"]

LLVM_FOLDERS = (
    "/usr/lib/*-linux-gnu",
    "/usr/lib/llvm-*/lib",
    "/usr/lib64",
    "/usr/lib",
    "/usr/local/lib",
    "/opt/homebrew/opt/llvm*/lib",
    "/usr/local/opt/llvm*/lib",
)
LLVM_MAJORS = RULES[followed_version()].llvm


class VariantProcess(JsonProcess):
    """Runs `python -m MODULE` for one variant; a context manager.

    Parameters
    ----------
    module
        Calls `answer_requests` when it is run.
    variant
        `scalar_rgb`, `llvm_ad_rgb`, ...
    job
        What the module is given at its start, in addition to the variant's name.
    time_limit
        Seconds for one answer, the start of Mitsuba included.

    Raises
    ------
    MitsubaError
        Why this variant cannot work here.
    """

    def __init__(
        self,
        module: str,
        variant: str,
        job: Mapping[str, Any],
        time_limit: float = TIME_LIMIT,
    ) -> None:
        self.variant = variant
        super().__init__(
            module,
            {"variant": variant, **job},
            name=variant,
            time_limit=time_limit,
            environment=_environment(variant),
        )


def find_llvm(folders: Sequence[str] = LLVM_FOLDERS) -> Path | None:
    """Return the newest LLVM library that Mitsuba can use, or None.

    Parameters
    ----------
    folders
        Absolute glob patterns of folders.
    """
    found: dict[int, Path] = {}
    for folder in folders:
        for library in sorted(Path("/").glob(folder.lstrip("/") + "/libLLVM*")):
            name = re.fullmatch(
                r"libLLVM(?:-(\d+)\.(?:so|dylib)|\.so\.(\d+)(?:\.\d+)*)", library.name
            )
            if name:
                found.setdefault(int(name[1] or name[2]), library)
    usable = [major for major in found if major in LLVM_MAJORS]
    return found[max(usable)] if usable else None


def _environment(variant: str) -> dict[str, str]:
    """Return where Mitsuba finds LLVM, unless the environment does."""
    if not variant.startswith("llvm") or "DRJIT_LIBLLVM_PATH" in os.environ:
        return {}
    library = find_llvm()
    if library is None:
        majors = f"{LLVM_MAJORS[0]} to {LLVM_MAJORS[-1]}"
        raise MitsubaError(f"{variant}: no libLLVM {majors} in the usual folders")
    return {"DRJIT_LIBLLVM_PATH": str(library)}
