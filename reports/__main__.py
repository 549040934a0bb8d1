"""`python -m reports`, also the command `lightproof-report`."""

from __future__ import annotations

from reports.starting import run


def main() -> int:
    """Measure studies, draw the pages; return the exit status."""
    return run("reports.command")


if __name__ == "__main__":
    raise SystemExit(main())
