"""Lets `python -m reports.history` draw the page."""

from reports.starting import run

if __name__ == "__main__":
    raise SystemExit(run("reports.history.command"))
