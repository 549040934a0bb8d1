"""What can go wrong on Mitsuba's side, as one line each."""

from __future__ import annotations


class MitsubaError(RuntimeError):
    """Mitsuba gave no picture; by itself, without a subclass, for a reason of ours."""


class MitsubaRefused(MitsubaError):
    """Mitsuba does not take the scene; its own sentence."""


class MitsubaCrashed(MitsubaError):
    """Mitsuba's process ended without an answer."""


class MitsubaTimeout(MitsubaError):
    """Mitsuba did not answer within the time limit and was ended."""
