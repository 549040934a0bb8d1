"""`python -m reports.benchmark`: ours and Mitsuba in turn, in one run."""

from __future__ import annotations

from reports.starting import run

if __name__ == "__main__":
    raise SystemExit(run("reports.commands.benchmark"))
