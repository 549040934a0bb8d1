"""docs/exercises.md says what is there."""

from __future__ import annotations

from pathlib import Path

from student_faults import FAULTS, MORE_FAULTS
from student_solutions import SOLUTIONS

from renderer.exercises.exercise_command import listed
from renderer.exercises.registry import EXERCISES

PAGE = (Path(__file__).parents[3] / "docs" / "exercises.md").read_text(encoding="utf-8")


def test_the_list_is_what_the_command_prints() -> None:
    assert "```\n" + "\n".join(listed()) + "\n```" in PAGE, "copy `lightproof exercise`"


def test_the_numbers_are_those_of_the_tests() -> None:
    mistakes = [one for exercise in EXERCISES.values() for one in exercise.mistakes]
    forms = sum(len(one.variants) for one in mistakes)
    files = sum(map(len, SOLUTIONS.values()))
    faults = len(FAULTS) + len(MORE_FAULTS)
    rows = (
        f"| the {len(mistakes)} mistakes in their {forms} forms | {forms} | {forms} |",
        f"now (a test) | {faults} | {faults} | 0 | 0 |",
        f"| right files, in other forms than ours | {files} | | 0 | {files} |",
    )
    assert not [row for row in rows if row not in PAGE]
    assert len(EXERCISES) == 16 and PAGE.startswith("# Exercises\n\nSixteen")
