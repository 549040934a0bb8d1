"""A student's file in a process of its own: it may loop, raise, print and exit.

The process appends a line of JSON to a file for each answer. So what it did before it was
stopped is known, and what the student's file prints goes where it always does.
"""

from __future__ import annotations

import contextlib
import copy
import dataclasses
import faulthandler
import io
import json
import os
import re
import subprocess
import sys
import tempfile
import types
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

import numpy as np

import renderer
from renderer.exercises.answers import plain, raised
from renderer.exercises.exercise import Exercise, Functions
from renderer.exercises.registry import exercise_named
from renderer.exercises.vectors import Vector

GRACE = 20.0  # [s] for the start of Python and NumPy on a busy machine


class StudentFileError(Exception):
    """The file cannot be checked; the message is one line without the file's name."""

    def __init__(self, message: str, line: int | None = None) -> None:
        super().__init__(message)
        self.line = line


@dataclass(frozen=True, eq=False)
class Run:
    """What a student's functions answered."""

    answers: list[Any]
    picture: Vector | None
    stopped: str  # why there are fewer answers than cases; "" if there are not
    line: int | None  # of the student's file, where it was stopped


def run_student(path: Path, exercise: Exercise, seconds: float, *, draw: bool) -> Run:
    """Return the answers of a student's functions to all cases.

    Parameters
    ----------
    path
        The student's file.
    exercise
        The exercise of the file.
    seconds
        The most time that the file, all answers and the picture may take together.
    draw
        Whether the picture is wanted.

    Raises
    ------
    StudentFileError
        If the file cannot be executed, or a function is not there.
    """
    paths = [str(Path(renderer.__file__).parents[1]), os.environ.get("PYTHONPATH", "")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))}
    sys.stdout.flush()
    with tempfile.TemporaryDirectory() as folder:
        results, stack = Path(folder, "results"), Path(folder, "stack")
        results.touch()
        words = [exercise.name, path.resolve(), results, stack, seconds, int(draw)]
        # -P: a student's file may be called random.py. The session is new so that Ctrl-C
        # reaches this process alone, which then ends the other.
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", __name__, *map(str, words)],
            stdin=subprocess.DEVNULL,
            env=environment,
            start_new_session=True,
        )
        try:
            status = process.wait(seconds + GRACE)
        except subprocess.TimeoutExpired:
            status = None
        finally:
            process.kill()
            process.wait()
        # the last line may be half written
        lines = [one for one in results.read_text().splitlines(True) if one.endswith("\n")]
        records = [json.loads(one) for one in lines]
        dumped = stack.read_text() if stack.exists() else ""
    return _read(records, dumped, status, path, seconds)


def _read(
    records: list[dict[str, Any]],
    stack: str,
    status: int | None,
    path: Path,
    seconds: float,
) -> Run:
    """Return what the process has written, whether or not it came to the end."""
    answers: list[Any] = []
    picture, finished = None, False
    for record in records:
        if "refused" in record:
            raise StudentFileError(record["refused"], record["line"])
        if "answer" in record:
            answers.append(record["answer"])
        if "picture" in record:
            picture = np.array(record["picture"], np.float64)
        finished = finished or "end" in record
    stopped, line = "", None
    if not finished:
        place = re.search(rf'File "{re.escape(str(path.resolve()))}", line (\d+)', stack)
        line = int(place[1]) if place else None
        late = bool(stack) or status is None
        stopped = f"did not end within {seconds:g} s" if late else "ended the process"
        if not late:
            stopped += f" with the status {status}"
    return Run(answers, picture, stopped, line)


def line_of(error: BaseException, path: Path) -> int | None:
    """Return the line of a file where an exception came from, or passed last."""
    line, trace = None, error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == str(path):
            line = trace.tb_lineno
        trace = trace.tb_next
    if isinstance(error, SyntaxError) and error.filename == str(path):
        line = error.lineno
    return line


def load(path: Path) -> types.ModuleType:
    """Execute a student's file; what stands below `if __name__ == "__main__"` does not run.

    Raises
    ------
    StudentFileError
        If that raises an exception.
    """
    module = types.ModuleType("student")
    module.__file__ = str(path)
    sys.modules["student"] = module
    sys.path.append(str(path.parent))  # last: a neighbour may be called random.py
    try:
        exec(compile(path.read_bytes(), str(path), "exec"), module.__dict__)
    except (Exception, SystemExit) as error:
        raise StudentFileError(_text(error), line_of(error, path)) from error
    return module


def functions_of(module: types.ModuleType, exercise: Exercise) -> Functions:
    """Return the functions of an exercise that a student's file defines."""
    names = [function.__name__ for function in exercise.functions]
    missing = [name for name in names if not callable(getattr(module, name, None))]
    if missing:
        defined = [
            name
            for name, value in vars(module).items()
            if isinstance(value, types.FunctionType) and value.__module__ == "student"
        ]
        raise StudentFileError(
            f"there is no function {missing[0]}; defined are: "
            f"{', '.join(defined) or 'none'}"
        )
    return types.SimpleNamespace(**{name: getattr(module, name) for name in names})


def _text(error: BaseException) -> str:
    first = (str(error).splitlines() or [""])[0][:200]
    return f"{type(error).__name__}: {first}" if first else type(error).__name__


def _serve(exercise: Exercise, path: Path, draw: bool, results: TextIO) -> None:
    """Write the answers of a student's functions."""

    def write(**record: Any) -> None:
        results.write(json.dumps(record) + "\n")
        results.flush()

    try:
        functions = functions_of(load(path), exercise)
    except StudentFileError as error:
        write(refused=str(error), line=error.line)
        return
    for case in exercise.questions():
        # a function that changes a list must not change it for other cases
        own = dataclasses.replace(case, arguments=copy.deepcopy(case.arguments))
        try:
            found = plain(own.answer_of(functions))
        except (Exception, SystemExit) as error:
            found = raised(_text(error), line_of(error, path))
        write(answer=found)
    if draw and exercise.picture is not None:
        try:
            # what it prints for thousands of pixels is of no use
            with contextlib.redirect_stdout(io.StringIO()):
                picture = exercise.picture(functions)
        except (Exception, SystemExit):
            picture = None  # the answers tell what is wrong
        if picture is not None:
            write(picture=picture.tolist())
    write(end=True)


def main() -> None:
    """Run as the process of `run_student`."""
    name, path, results, stack, seconds, draw = sys.argv[1:]
    warnings.simplefilter("ignore")  # NumPy's, such as of a division by 0
    with open(results, "a") as answers, open(stack, "w") as dumped:
        # it ends the process whatever it does: no handler of a signal runs in a loop of C,
        # and a bare `except` catches what a handler raises
        faulthandler.dump_traceback_later(float(seconds), exit=True, file=dumped)
        _serve(exercise_named(name), Path(path), bool(int(draw)), answers)
        faulthandler.cancel_dump_traceback_later()
    sys.stdout.flush()
    os._exit(0)  # threads of the student's file do not keep it


if __name__ == "__main__":
    main()
