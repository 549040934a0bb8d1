"""`python -m reports.calibration`: whether the error that a render claims is its error."""

from __future__ import annotations

from reports.starting import run

if __name__ == "__main__":
    raise SystemExit(run("reports.commands.calibration"))
