"""`python -m renderer`: render a scene file."""

import sys

from renderer.cli import main

if __name__ == "__main__":
    sys.exit(main())
