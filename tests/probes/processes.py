"""Processes of this Python that tests wait for."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any


def run_python(
    *words: Any,
    folder: Path | None = None,
    environment: dict[str, str] | None = None,
    check: bool = False,
) -> subprocess.CompletedProcess[str]:
    """Run to the end, with what is printed as text; `check` asserts that it went well."""
    done = subprocess.run(
        [sys.executable, *map(str, words)],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert not check or done.returncode == 0, done.stderr
    return done
