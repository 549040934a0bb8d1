"""The budget of code: lines and files of each room, against the table in pyproject.toml.

An ability that is added pays with a deletion, or raises the budget in the same commit with
a reason in its message. A budget far above what is there would allow what it shall prevent,
so a room that has shrunk lowers it.
"""

import ast
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BUDGET = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["lightproof"][
    "budget"
]
ROOMS = {room: limits for room, limits in BUDGET.items() if isinstance(limits, dict)}
SLACK = 0.05  # a budget may exceed what is there by this part


def code_lines(source: str) -> int:
    """Return how many lines hold more than a comment, a docstring or nothing."""
    docstrings = set()
    for node in ast.walk(ast.parse(source)):
        body = getattr(node, "body", None)
        first = body[0] if isinstance(body, list) and body else None
        if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
            docstrings |= set(range(first.lineno, first.end_lineno + 1))
    lines = enumerate(map(str.strip, source.splitlines()), 1)
    code = {k for k, line in lines if line and not line.startswith("#")}
    return len(code - docstrings)


def import_lines(source: str) -> int:
    """Return how many lines imports take."""
    imports = (ast.Import, ast.ImportFrom)
    found = [node for node in ast.walk(ast.parse(source)) if isinstance(node, imports)]
    return sum(node.end_lineno - node.lineno + 1 for node in found)


def files_of(room: str) -> list[Path]:
    """Return the files of a folder, or of the folder alone where others are rooms in it."""
    inner = [ROOT / other for other in ROOMS if other.startswith(f"{room}/")]
    return [
        file
        for file in sorted((ROOT / room).rglob("*.py"))
        if not any(folder in file.parents for folder in inner)
    ]


def test_code_is_counted_without_comments_docstrings_and_blank_lines():
    source = '"""A docstring\n\nof three lines."""\n\nimport math  # one\n\n# none\n'
    source += 'def f():\n    """None."""\n    return (\n        1\n    )\n'
    assert code_lines(source) == 5
    assert import_lines("import a\nfrom b import (\n    c,\n)\nx = 1\n") == 4


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_keeps_its_budget(room):
    files, limits = files_of(room), ROOMS[room]
    assert files, f"{room} of the budget in pyproject.toml does not exist"
    lines = sum(code_lines(file.read_text()) for file in files)
    for what, found, least_slack in (("code", lines, 40), ("files", len(files), 1)):
        most = limits[what]
        assert found <= most, (
            f"{room} has {found} ({what}), its budget is {most}: delete something, or "
            "raise it in pyproject.toml with a reason"
        )
        slack = max(least_slack, SLACK * most)
        assert found >= most - slack, f"{room} has {found} ({what}): lower {most} to that"


def test_every_folder_of_the_renderer_has_a_budget():
    folders = {
        f"renderer/{file.parent.name}" for file in ROOT.glob("renderer/*/__init__.py")
    }
    assert folders <= set(ROOMS)


def test_imports_of_the_renderer_are_a_small_part_of_its_code():
    sources = [file.read_text() for file in (ROOT / "renderer").rglob("*.py")]
    part = sum(map(import_lines, sources)) / sum(map(code_lines, sources))
    assert part <= BUDGET["imports"]
