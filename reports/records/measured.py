"""The records of long measurements that live in the repository, in `reports/measured`."""

from __future__ import annotations

import json
from pathlib import Path

from reports.errors import ReportError

MEASURED = Path(__file__).resolve().parents[1] / "measured"


def newest(path: Path) -> Path:
    """Return the record at `path`, or the repository's of that name if that is newer.

    `path` itself is returned where neither exists.

    Raises
    ------
    ReportError
        If one of two cannot be read, so that nobody knows which is newer.
    """
    kept = MEASURED / path.name
    if not kept.is_file() or path.resolve() == kept:
        return path
    if not path.is_file():
        return kept
    return max(path, kept, key=created)


def created(path: Path) -> str:
    """Return when a record was made, ISO 8601, which sorts by time; "" if it is not said.

    Raises
    ------
    ReportError
        One line: what is wrong with the file.
    """
    try:
        content = json.loads(path.read_bytes())
    except (OSError, ValueError) as error:
        raise ReportError(f"{path}: no record: {error}") from None
    return str(content.get("created", "")) if isinstance(content, dict) else ""
