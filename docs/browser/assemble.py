"""Put the page together: `python docs/browser/assemble.py OUTPUT --pyodide FOLDER`.

FOLDER holds a release of Pyodide with the wheel of NumPy that its pyodide-lock.json names.
Only the files that the page loads are copied. Without `--pyodide` the page says that Python
is missing. Serve OUTPUT by any server: `python -m http.server -d OUTPUT`.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
PAGE = ("index.html", "worker.js")
PYTHON = ("stand_ins.py", "rows.py")
SCENE = ROOT / "scenes" / "cornell-box" / "scene.xml"
# of Pyodide: the last two by the version, 0.28 and newer have .mjs
CORE = ("pyodide.mjs", "pyodide-lock.json", "python_stdlib.zip", "pyodide.asm.wasm")
EITHER = ("pyodide.asm.js", "pyodide.asm.mjs")


def assemble(output: Path, pyodide: Path | None) -> None:
    """Write the page and what it loads to a folder.

    Raises
    ------
    FileNotFoundError
        If a file of Pyodide, or NumPy's wheel, is missing.
    """
    output.mkdir(parents=True, exist_ok=True)
    for name in PAGE:
        shutil.copy(HERE / name, output)
    shutil.copy(SCENE, output / "scene.xml")
    with zipfile.ZipFile(output / "renderer.zip", "w", zipfile.ZIP_DEFLATED) as sources:
        for name in PYTHON:
            sources.write(HERE / name, name)
        for pattern in ("*.py", "*.npz"):
            for file in sorted((ROOT / "renderer").rglob(pattern)):
                sources.write(file, file.relative_to(ROOT))
    if pyodide is not None:
        (output / "pyodide").mkdir(exist_ok=True)
        for name in needed(pyodide):
            shutil.copy(pyodide / name, output / "pyodide")


def needed(pyodide: Path) -> list[str]:
    """Return the names of the files of Pyodide that the page loads."""
    lock = json.loads((pyodide / "pyodide-lock.json").read_text(encoding="utf-8"))
    wheel = lock["packages"]["numpy"]["file_name"]
    core = [name for name in EITHER if (pyodide / name).is_file()]
    return [*CORE, *core, wheel]


def main(arguments: Sequence[str] | None = None) -> int:
    """Assemble the page; return the exit status: 0 done, 2 a file is missing."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("output", type=Path, metavar="OUTPUT")
    parser.add_argument("--pyodide", type=Path, metavar="FOLDER")
    given = parser.parse_args(arguments)
    try:
        assemble(given.output, given.pyodide)
    except OSError as error:
        sys.stderr.write(f"assemble.py: {error.filename}: {error.strerror}\n")
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
