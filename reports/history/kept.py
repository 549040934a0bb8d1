"""Which records the repository keeps: whole ones, of a commit, newer than what is there.

They are copied by hand (`make keep`) and not by the commands that measure, so that trying
something never changes what the pages of a fresh clone show.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mitsuba_ref.records.json_files import write_atomically
from reports.bench.without_paths import without_paths
from reports.errors import ReportError
from reports.records.measured import MEASURED

Content = dict[str, Any]

# options with which the command measures a part, or with another setting than the others
PARTIAL = {
    "matrix.json": ("--only",),
    "false_alarms.json": ("--pairs", "--scene", "--size", "--spp", "--seeds"),
    "register.json": ("--quick", "--only"),
    "calibration.json": ("--error", "--seeds"),
    "benchmark.json": ("--size", "--spp", "--rounds", "--threads", "--no-cold", "--scene"),
    "compile_times.json": (),
    "peers.json": ("--rounds", "--threads"),
    "accelerators.json": ("--quick",),
    "limits.json": ("--quick", "--only"),
    "needs.json": ("--spp", "--seeds", "--tolerance", "--timed", "-D"),
    "soak.json": (),
}
# options without which it measures a part
NEEDED = {"accelerators.json": "--full", "needs.json": "all"}
# options that change nothing of what is measured, and take a word
ANYWHERE = ("--out", "--jobs", "--budget", "--record")
LARGEST = 400_000  # [bytes] of a record


def keep(folder: Path, measured: Path | None = None) -> Iterator[str]:
    """Copy the records of a page's `data` that are worth it; yield a line about each.

    Parameters
    ----------
    folder
        Where they are, or in its `proof`.
    measured
        Where they go; None: `reports/measured`.

    Raises
    ------
    ReportError
        If a file is no record.
    """
    target = MEASURED if measured is None else measured
    for name in PARTIAL:
        for path in (folder / name, folder / "proof" / name):
            if path.is_file():
                content = _read(path)
                reason = partial(name, content) or _older(content, target / name)
                if not reason:
                    write_atomically(target / name, _slim(name, content))
                yield f"{path}: {'kept' if not reason else 'not kept, ' + reason}"


def partial(name: str, content: Content) -> str:
    """Return why a record is not kept, or ""."""
    words = shlex.split(str(content.get("command", "")))[3:]  # after python -m module
    for word in words:
        short = word[:2] if word[:2] == "-D" else word  # -Dwidth=8 is one word
        if short.split("=")[0] in PARTIAL[name]:
            return f"it was measured with {word}"
    if not content.get("whole", True):
        return "it is not whole: something was refused, or the command was interrupted"
    if (needed := NEEDED.get(name)) and needed not in words:
        return f"it was measured without {needed}"
    if name == "calibration.json" and _names(words):
        return "it was measured on some scenes"
    commit = str(content.get("commit", "unknown"))
    if commit == "unknown" or commit.endswith("-dirty"):
        return f"it is of no commit ({commit})"
    return ""


def _names(words: list[str]) -> list[str]:
    """Return the words that are neither options nor belong to one."""
    pairs = zip(["", *words], words, strict=False)
    return [
        word
        for before, word in pairs
        if not word.startswith("-") and before not in ANYWHERE
    ]


def _older(content: Content, kept: Path) -> str:
    there = _read(kept).get("created", "") if kept.is_file() else ""
    return f"the one there is of {there}" if content.get("created", "") <= there else ""


def _slim(name: str, content: Content) -> bytes:
    """Return the record without its pictures, and without the paths of this machine."""
    content = without_paths(content)
    if name == "limits.json":
        content = {**content, "rows": [{**row, "picture": ""} for row in content["rows"]]}
    if name == "accelerators.json":
        content = {**content, "maps": []}
    text = json.dumps(content, indent=1, ensure_ascii=False) + "\n"
    if len(text) > LARGEST:
        text = json.dumps(content, ensure_ascii=False) + "\n"
    return text.encode()


def _read(path: Path) -> Content:
    try:
        content = json.loads(path.read_bytes())
    except (OSError, ValueError) as error:
        raise ReportError(f"{path}: no record: {error}") from None
    if not isinstance(content, dict):
        raise ReportError(f"{path}: no record: expected an object")
    return content
