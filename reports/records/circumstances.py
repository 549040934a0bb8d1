"""Where the numbers of one file come from."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Circumstances:
    """What every record of measurements begins with."""

    created: str = ""  # ISO 8601
    command: str = ""
    commit: str = "unknown"
    machine: dict[str, Any] = field(default_factory=dict)
    versions: dict[str, str] = field(default_factory=dict)
