"""The effort of a full study, as `beside_peers` names it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """See `trials.ray_times.Effort`."""

    pixels: int = 768
    rounds: int = 5
    build_rounds: int = 3
    seconds: float = 0.25


FULL = Settings()
