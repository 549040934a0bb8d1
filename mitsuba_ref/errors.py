"""What can go wrong on Mitsuba's side, as one line."""

from __future__ import annotations


class MitsubaError(RuntimeError):
    """Mitsuba refused the scene, crashed, or did not answer in time."""
