"""Lets `python -m reports.speed_accuracy` run the measurement."""

from reports.starting import run

if __name__ == "__main__":
    raise SystemExit(run("reports.commands.speed_accuracy"))
