"""The one exception that unusable results raise."""

from __future__ import annotations


class ReportError(ValueError):
    """Results, or a file they name, cannot be shown.

    The message is one line: where, what was found, what is possible.
    """


class OptionError(ReportError):
    """An option of a study has a value that it cannot have; nothing is measured."""
