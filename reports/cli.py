"""The command `lightproof-report`, also `python -m reports`."""

from __future__ import annotations

from reports.starting import run


def main() -> int:
    """Render, compare, draw the pages; return the exit status."""
    return run("reports.commands.report")
