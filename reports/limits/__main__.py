"""`python -m reports.limits`: measure where methods fail, draw the atlas."""

from __future__ import annotations

from reports.starting import run

if __name__ == "__main__":
    raise SystemExit(run("reports.commands.limits"))
