"""`python -m reports.proof`: replay and test every scene, draw the page."""

from __future__ import annotations

from reports.starting import run

if __name__ == "__main__":
    raise SystemExit(run("reports.commands.proof"))
