"""`lightproof exercise`: list the exercises, write one, give a hint."""

from __future__ import annotations

import argparse
import sys
import textwrap
from collections.abc import Sequence
from pathlib import Path

from renderer.errors import SceneError
from renderer.exercises.exercise import WIDTH, Exercise, stub
from renderer.exercises.pictures import png
from renderer.exercises.registry import CHAPTERS, EXERCISES
from renderer.process.short_command import INTERRUPTED, WRONG_USE, run_command
from renderer.process.whole_file import write_whole

DONE = 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Do what the command line says; return the exit status."""
    given = _parser().parse_args(sys.argv[1:] if arguments is None else arguments)
    return run_command("lightproof exercise", lambda: _run(given))


def _run(given: argparse.Namespace) -> int:
    if given.name is None:
        if given.output or given.hint is not None:
            raise SceneError("name an exercise, such as: lightproof exercise triangle")
        for line in listed():
            sys.stdout.write(line + "\n")
        return DONE
    exercise = EXERCISES.get(given.name)
    if exercise is None:
        raise SceneError(
            f"there is no exercise {given.name!r}; possible is: {', '.join(EXERCISES)}"
        )
    if given.hint is not None:
        return _hint(exercise, given.hint)
    return _write(exercise, given.output or Path(f"{exercise.name}.py"), given.force)


def listed() -> list[str]:
    """Return the list of exercises, by the chapters of the lecture."""
    lines: list[str] = []
    for number, (title, exercises) in enumerate(CHAPTERS.items(), 1):
        lines += ["", f"{number}. {title}"] if lines else [f"{number}. {title}"]
        lines += [f"   {one.name:<13} {one.summary}." for one in exercises]
    return [*lines, "", "Write one:  lightproof exercise triangle"]


def _hint(exercise: Exercise, number: int) -> int:
    count = len(exercise.hints)
    if not 1 <= number <= count:
        raise SceneError(f"{exercise.name} has hints 1 to {count}")
    text = f"Hint {number} of {count}: {exercise.hints[number - 1]}"
    sys.stdout.write(textwrap.fill(text, WIDTH) + "\n")
    if number < count:
        more = f"lightproof exercise {exercise.name} --hint {number + 1}"
        sys.stdout.write(f"The next one:  {more}\n")
    return DONE


def _write(exercise: Exercise, path: Path, force: bool) -> int:
    """Write the stub, and the picture to reach next to it."""
    goal = path.with_name(f"{path.stem}_goal.png")
    if path.suffix != ".py":
        raise SceneError(f"{path}: the name of a Python file ends in .py")
    if path.exists() and not force:
        raise SceneError(f"{path} exists; --force replaces it")
    write_whole(path, stub(exercise, path).encode())
    sys.stdout.write(f"wrote {path}: {exercise.summary}\n")
    if exercise.picture is not None:
        write_whole(goal, png([exercise.picture(exercise.right())]))
        sys.stdout.write(f"wrote {goal}: the picture to reach\n")
    sys.stdout.write(f"When it is done:  lightproof check {path}\n")
    return DONE


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="lightproof exercise",
        allow_abbrev=False,
        description="Without a name: list the exercises. With a name: write a Python file "
        "with a function to fill in, and the picture to reach.",
        epilog=f"Exit status: {DONE} done, {WRONG_USE} the command line is wrong or a file "
        f"cannot be written, {INTERRUPTED} interrupted. "
        "Example: lightproof exercise triangle",
    )
    add = parser.add_argument
    add("name", nargs="?", metavar="NAME", help="of an exercise, such as triangle")
    add("-o", dest="output", type=Path, metavar="FILE.py", help="default: NAME.py")
    add("--force", action="store_true", help="replace a file that exists")
    add(
        "--hint",
        nargs="?",
        type=int,
        const=1,
        metavar="NUMBER",
        help="write nothing, and show a hint; the last one is nearly the answer",
    )
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
