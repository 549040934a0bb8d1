"""`python -m mitsuba_ref`: render scenes in both renderers and compare them."""

import sys

from mitsuba_ref.command.cli import main

if __name__ == "__main__":
    sys.exit(main())
