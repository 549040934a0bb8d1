"""What bad input raises."""

from __future__ import annotations


class SceneError(ValueError):
    """A scene, or a file it names, cannot be rendered.

    The message is one line: where (file and line), what was found, what is possible.
    """


class NotReplayable(SceneError):
    """A scene can be rendered, but not with Mitsuba's random numbers in its order."""
