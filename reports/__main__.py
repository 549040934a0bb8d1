"""`python -m reports`."""

import sys

from reports.starting import run

if __name__ == "__main__":
    # the pages that are no studies yet
    old = {"--no-proof", "--proof", "--from"}
    command = "reports.commands.report" if old & set(sys.argv) else "reports.command"
    raise SystemExit(run(command))
