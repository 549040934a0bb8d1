"""`python -m reports.scaling`: what a cluster costs, and how far it carries."""

from __future__ import annotations

from reports.starting import run

if __name__ == "__main__":
    raise SystemExit(run("reports.commands.scaling"))
