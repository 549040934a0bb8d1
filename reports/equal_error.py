"""`python -m reports.equal_error`: error times time, of samplers and of renderers."""

from __future__ import annotations

from reports.starting import run

if __name__ == "__main__":
    raise SystemExit(run("reports.commands.equal_error"))
