"""`lightproof exercise` and `lightproof check`, as a student uses them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from processes import run_python
from student_solutions import TRIANGLE_MOELLER

from renderer.exercises import check_command, exercise_command
from renderer.exercises.registry import EXERCISES

HEAD = 'import math, os\nimport numpy as np\nEXERCISE = "triangle"\n'
ROOT = Path(__file__).parents[3]


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def checked(capfd: Any, text: str | bytes, *options: str) -> tuple[int, str]:
    """Check a file; return the status and all that was printed."""
    Path("mine.py").write_bytes(text if isinstance(text, bytes) else text.encode())
    status = check_command.main(["mine.py", "--no-picture", *options])
    out, err = capfd.readouterr()
    assert "Traceback" not in out + err
    return status, out + err


def test_the_list_names_every_exercise(capsys: Any) -> None:
    assert exercise_command.main([]) == 0
    text = capsys.readouterr().out
    for one in EXERCISES.values():
        assert f" {one.name} " in text and one.summary in text


def test_an_exercise_is_written_once(capsys: Any) -> None:
    assert exercise_command.main(["sphere"]) == 0
    assert Path("sphere_goal.png").read_bytes()[1:4] == b"PNG"
    Path("sphere.py").write_text("my work")
    assert exercise_command.main(["sphere"]) == 2
    assert "--force" in capsys.readouterr().err
    assert Path("sphere.py").read_text() == "my work"
    assert exercise_command.main(["sphere", "-o", "my.py"]) == 0
    assert "my_goal.png" in Path("my.py").read_text() and Path("my_goal.png").exists()
    assert exercise_command.main(["sphere", "--force"]) == 0
    assert "my work" not in Path("sphere.py").read_text()
    assert check_command.main(["sphere.py"]) == 1
    assert "sphere.py:40: intersect_sphere is not written yet" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["circle"], "there is no exercise 'circle'; possible is: camera"),
        (["sphere", "-o", "no/such.py"], "there is no folder"),
        (["sphere", "-o", "sphere.txt"], "ends in .py"),
        (["sphere", "--hint", "9"], "hints 1 to 3"),
        (["--hint"], "name an exercise"),
    ],
)
def test_wrong_words_are_one_line(capsys: Any, words: list[str], expected: str) -> None:
    assert exercise_command.main(words) == 2
    text = capsys.readouterr().err
    assert expected in text and text.count("\n") == 1
    assert not list(Path().iterdir())


def test_hints_come_one_at_a_time(capsys: Any) -> None:
    assert exercise_command.main(["sphere", "--hint"]) == 0
    text = capsys.readouterr().out
    assert "Hint 1 of 3" in text and "--hint 2" in text
    assert exercise_command.main(["sphere", "--hint", "3"]) == 0
    assert "--hint 4" not in capsys.readouterr().out


def test_a_right_file_is_right_and_prints(capfd: Any) -> None:
    """The exercise is known by the function's name, without the constant."""
    text = f"import numpy as np\nprint('hello')\n{TRIANGLE_MOELLER}"
    Path("mine.py").write_text(text)
    assert check_command.main(["mine.py"]) == 0
    out = capfd.readouterr().out
    assert "hello" in out and "mine.py: right." in out
    assert Path("mine_check.png").read_bytes()[1:4] == b"PNG"


def test_a_wrong_file_is_explained(capfd: Any) -> None:
    text = HEAD + TRIANGLE_MOELLER.replace("t <= t_min or ", "")
    status, said = checked(capfd, text, "--json", "verdict.json")
    assert status == 1
    assert "First failure: a triangle behind the ray." in said
    assert "    direction = [0, 0, 1]\n" in said
    assert "    expected: None\n    found:    [-3, 0.25, 0.25]\n" in said
    assert "The mistake is no-t-min (explains " in said
    page = (ROOT / "docs" / "exercises.md").read_text(encoding="utf-8")
    assert said.replace("mine.py", "triangle.py") in page
    record = json.loads(Path("verdict.json").read_text())
    assert (record["status"], record["exercise"]) == ("wrong", "triangle")
    assert record["mistakes"][0]["names"] == ["no-t-min"]
    assert record["first_failure"]["found"] == "[-3, 0.25, 0.25]"


@pytest.mark.parametrize(
    ("body", "line", "expected"),
    [
        ("return 1 / 0", 5, "found:    ZeroDivisionError: division by zero in line 5"),
        ("return 1, 2", 0, "found:    [1, 2]"),
        ("return 'hit'", 0, "found:    hit"),
        ("return object", 0, "of the type type"),
        ("return np.nan, np.zeros(2), None", 0, "found:    [nan, [0, 0], None]"),
        ("exit(7)", 5, "found:    SystemExit: 7 in line 5"),
        ("return intersect_triangle(*a)", 5, "found:    RecursionError"),
        ("while True: pass", 5, "mine.py:5: wrong. The file did not end within 0.5 s."),
        (
            "import os; os._exit(7)",
            0,
            "wrong. The file ended the process with the status 7",
        ),
    ],
)
def test_what_a_function_may_do(capfd: Any, body: str, line: int, expected: str) -> None:
    text = f"{HEAD}def intersect_triangle(*a):\n    {body}\n"
    status, said = checked(capfd, text, "--time-limit", "0.5" if "while" in body else "60")
    assert status == 1
    assert expected in said


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("def f(:\n", "mine.py:1: syntax error: invalid syntax"),
        (b"\xff\xfe", "syntax error"),
        (b"x = 1\0", "null bytes"),
        ("x = 1\n", "which exercise is this?"),
        ('EXERCISE = "ring"\n', "mine.py:1: there is no exercise 'ring'"),
        (
            HEAD + "def other(): pass\n",
            "no function intersect_triangle; defined are: other",
        ),
        (HEAD + "import no_such\n", "mine.py:4: ModuleNotFoundError: No module named"),
        (HEAD + "exit()\n", "mine.py:4: SystemExit"),
    ],
)
def test_what_cannot_be_checked_is_one_line(
    capfd: Any, text: str | bytes, expected: str
) -> None:
    status, said = checked(capfd, text)
    assert status == 2
    assert expected in said and said.count("\n") == 1


def test_a_file_that_is_not_there(capfd: Any) -> None:
    assert check_command.main(["mine.py"]) == 2
    assert "mine.py: No such file" in capfd.readouterr().err
    assert check_command.main(["."]) == 2


def test_a_neighbour_of_the_file_may_have_any_name(capfd: Any) -> None:
    """Nothing of the check imports it, and the student's file may import others."""
    Path("random.py").write_text("raise ValueError('imported')\n")
    Path("my_vectors.py").write_text("from numpy import cross\n")
    text = f"from my_vectors import cross\n{HEAD}{TRIANGLE_MOELLER}"
    assert checked(capfd, text)[0] == 0


@pytest.mark.parametrize("word", ["exercise", "check"])
def test_help_states_the_statuses_and_imports_nothing_slow(word: str) -> None:
    done = run_python(
        *("-X", "importtime", "-m", f"renderer.exercises.{word}_command", "--help"),
        environment={"PYTHONPATH": str(ROOT)},
    )
    assert done.returncode == 0
    assert "Exit status: 0 " in done.stdout and "Example: lightproof" in done.stdout
    modules = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
    assert "renderer.exercises.registry" in modules
    assert not modules & {"numba", "llvmlite", "scipy", "PIL", "OpenEXR", "rich"}


@pytest.mark.parametrize("command", [check_command, exercise_command])
def test_an_interrupt_ends_quietly(
    capfd: Any, monkeypatch: pytest.MonkeyPatch, command: Any
) -> None:
    def interrupted(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(check_command, "run_student", interrupted)
    monkeypatch.setattr(exercise_command, "stub", interrupted)
    Path("sphere.py").write_text(HEAD)
    name = "sphere.py" if command is check_command else "camera"
    assert command.main([name]) == 130
    assert capfd.readouterr() == ("", "")


def test_cases_do_not_depend_on_what_a_function_does_to_its_arguments(capfd: Any) -> None:
    text = "def direct_light(x, n, albedo, lights, is_blocked):\n    x[:] = 0\n    {}"
    first = checked(capfd, text.format("return 0.0\n"))
    assert checked(capfd, text.format("lights.clear()\n    return 0.0\n")) == first
