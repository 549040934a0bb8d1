"""`python -m reports.accelerators`: measure every accelerator, draw the page."""

from __future__ import annotations

from reports.starting import run

if __name__ == "__main__":
    raise SystemExit(run("reports.commands.accelerators"))
