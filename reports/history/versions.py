"""All versions of a record: what git has, oldest first, and what is there."""

from __future__ import annotations

import json
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reports.errors import ReportError

NOT_COMMITTED = "not committed"


@dataclass(frozen=True)
class Version:
    """A record as it was at one commit."""

    commit: str  # that brought it in
    created: str  # when it was measured
    measured_at: str  # the commit of the sources then
    content: dict[str, Any]


def clone_of(folder: Path) -> Path:
    """Return the root of the git clone that a folder is in.

    Raises
    ------
    ReportError
        If there is none, or no git.
    """
    told = _git(folder, "rev-parse", "--show-toplevel")
    if told is None or not told.strip():
        raise ReportError(
            f"{folder} is not in a git clone (or git is missing), and only a clone knows "
            "how records changed over commits"
        )
    return Path(told.strip())


def versions_of(path: Path) -> list[Version]:
    """Return all versions of a record, oldest first; unreadable ones are left out.

    Raises
    ------
    ReportError
        If it is in no clone.
    """
    root = clone_of(path.parent)
    place = path.resolve().relative_to(root.resolve()).as_posix()
    told = _git(root, "log", "--reverse", "--format=%h", "--", place) or ""
    found = []
    for commit in told.split():
        text = _git(root, "show", f"{commit}:{place}")
        if text is not None and (version := _version(commit, text)) is not None:
            found.append(version)
    if path.is_file():
        text = path.read_text(encoding="utf-8", errors="replace")
        now = _version(NOT_COMMITTED, text)
        if now is not None and (not found or now.content != found[-1].content):
            found.append(now)
    return found


def _version(commit: str, text: str) -> Version | None:
    try:
        content = json.loads(text)
    except ValueError:
        return None
    if not isinstance(content, dict):
        return None
    created, measured_at = (str(content.get(key, "")) for key in ("created", "commit"))
    return Version(commit, created, measured_at, content)


def _git(folder: Path, *words: str) -> str | None:
    try:
        run = subprocess.run(
            ["git", *words], cwd=folder, capture_output=True, encoding="utf-8", timeout=60
        )
    except (OSError, subprocess.TimeoutExpired, UnicodeDecodeError):
        return None
    return run.stdout if run.returncode == 0 else None
