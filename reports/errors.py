"""The one exception that unusable results raise."""

from __future__ import annotations


class ReportError(ValueError):
    """Results, or a file they name, cannot be shown.

    The message is one line: where, what was found, what is possible.
    """
