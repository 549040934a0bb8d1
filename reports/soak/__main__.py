"""Lets `python -m reports.soak` run the trials."""

from reports.starting import run

if __name__ == "__main__":
    raise SystemExit(run("reports.soak.command"))
