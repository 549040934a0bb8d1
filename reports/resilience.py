"""`python -m reports.resilience`: a picture killed and resumed is that of one go."""

from __future__ import annotations

from reports.starting import run

if __name__ == "__main__":
    raise SystemExit(run("reports.commands.resilience"))
