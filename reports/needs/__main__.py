"""Lets `python -m reports.needs` run the study."""

from reports.starting import run

if __name__ == "__main__":
    raise SystemExit(run("reports.needs.command"))
