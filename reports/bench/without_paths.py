"""Records without the paths of the machine that they were measured on."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

_CLONE = Path(__file__).resolve().parents[2]
# Of two folders or more, at the beginning of a word: what follows a letter is a unit such
# as W/m^2/sr or a relative path, what follows a comma or a colon is data or an address
# unless it begins with a folder that machines have.
_PATH = re.compile(
    r"""(?:(?<![^\s"'=(\[|`])|(?<=[:,])(?=/(?:home|root|tmp|Users|work)/))"""
    r"""(?:/[\w.@+~-]+){2,}"""
)
_INSTALLED = re.compile(r"/(\.venv/|site-packages/)")


def without_paths(value: Any) -> Any:
    """Return what JSON holds with each absolute path in its texts made short.

    One in this clone is then relative to it, one of an installed package begins where it
    is installed, and of any other its last name is left.
    """
    if isinstance(value, dict):
        return {key: without_paths(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [without_paths(part) for part in value]
    return _PATH.sub(_short, value) if isinstance(value, str) else value


def _short(found: re.Match[str]) -> str:
    path = Path(found[0])
    if path.is_relative_to(_CLONE):
        return str(path.relative_to(_CLONE))
    if installed := _INSTALLED.search(found[0]):
        return found[0][installed.start(1) :]
    return path.name
