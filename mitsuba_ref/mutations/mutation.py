"""A mutation: a named defect of the renderer, and a copy of the renderer that has it."""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import renderer
from mitsuba_ref.mutations.source_edit import (
    AnchorError,
    Edit,
    definitions_with,
    edited_text,
    find_definition,
)
from renderer.process.cache_folder import cache_folder

PACKAGE = Path(renderer.__file__).parent


@dataclass(frozen=True)
class Mutation:
    """A defect with a name, or (`harmful` false) a change that no check may see."""

    name: str
    does: str  # what is wrong, one phrase
    edits: tuple[Edit, ...]
    scene: str  # the smallest scene that shows it: a folder of scenes/ or of ours
    tests: tuple[str, ...] = ()  # of `make test`, "test_file.py::test": they see it too
    harmful: bool = True
    remark: str = ""  # why a rung is blind for it


def mutated_files(mutation: Mutation, package: Path = PACKAGE) -> dict[str, str]:
    """Return the new text of each file that a mutation touches, by its path in `package`.

    Raises
    ------
    AnchorError
        If a definition or a text in it is not there exactly once.
    """
    texts: dict[str, str] = {}
    for edit in mutation.edits:
        try:
            place = find_definition(edit.symbol, package)
            name = place.path.relative_to(package).as_posix()
            source = texts.get(name) or place.path.read_text(encoding="utf-8")
            texts[name] = edited_text(source, edit, place)
        except AnchorError as error:
            there = ", ".join(definitions_with(edit.old, package)) or "no definition"
            raise AnchorError(
                f"mutation {mutation.name}: {error}; the text is in: {there}"
            ) from None
    return texts


def mutant_folder(mutation: Mutation, root: Path | None = None) -> Path:
    """Return the folder that holds the mutated copy of `renderer/`, made if need be.

    Its name ends with a hash of all the sources, so that it is found again as long as
    neither the renderer nor the mutation changes; then it is made anew and the old one is
    deleted. Numba finds its kernels by path and time of a source: both stay.

    Parameters
    ----------
    mutation
        What to change.
    root
        Where the folders are; default `mutants` in lightproof's cache.

    Raises
    ------
    AnchorError
        If the mutation does not fit the sources.
    """
    root = root or cache_folder("mutants")
    texts = mutated_files(mutation)
    folder = root / _name(mutation, texts)
    if folder.is_dir():
        return folder
    root.mkdir(parents=True, exist_ok=True)
    _delete(root.glob(f"{mutation.name}-{'[0-9a-f]' * 16}"))
    made = Path(tempfile.mkdtemp(dir=root, prefix=".new-"))
    # With the bytecode of what stays the same, or its process would compile 400 files;
    # without what another process is writing just now, as `x.cpython-311.pyc.140352`.
    half_written = shutil.ignore_patterns("*.pyc.*")
    shutil.copytree(PACKAGE, made / "renderer", ignore=half_written)
    for name, text in texts.items():
        changed = made / "renderer" / name
        changed.write_text(text, encoding="utf-8")
        # equal size and second of the clock would make it that of the new text
        _delete(changed.parent.glob("__pycache__"))
    with suppress(OSError):  # another process was first
        os.rename(made, folder)
    _delete([made])
    return folder


def mutant_name(mutation: Mutation) -> str:
    """Return the name of a mutant's folder, which tells its sources from any others."""
    return _name(mutation, mutated_files(mutation))


def _name(mutation: Mutation, texts: dict[str, str]) -> str:
    return f"{mutation.name}-{sources_hash(texts)}"


def _delete(folders: Iterable[Path]) -> None:
    for folder in folders:
        shutil.rmtree(folder, ignore_errors=True)


def sources_hash(texts: dict[str, str]) -> str:
    """Return a hash of the renderer with the text of some of its files replaced."""
    digest = hashlib.sha256()
    for source in sorted(PACKAGE.rglob("*.py")):
        name = source.relative_to(PACKAGE).as_posix()
        text = texts.get(name)
        digest.update(f"\0{name}\0".encode())
        digest.update(source.read_bytes() if text is None else text.encode())
    return digest.hexdigest()[:16]
