"""Tests lie in rooms: what they share is in tests/probes, and none imports another."""

from __future__ import annotations

import ast
from pathlib import Path

TESTS = Path(__file__).parents[1]
ROOMS = ("probes", "project", "renderer")  # those that keep the rule


def imported(file: Path) -> set[str]:
    """Return the modules that a file imports."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom):
            found.add(node.module or "")
        elif isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
    return {module.rpartition(".")[2] for module in found}


def test_no_test_imports_another() -> None:
    tests = {file.stem for file in TESTS.rglob("test_*.py")}
    files = [file for room in ROOMS for file in (TESTS / room).rglob("*.py")]
    assert len(files) > 100
    wrong = {file.name: imported(file) & tests for file in files if imported(file) & tests}
    assert not wrong


def test_two_tests_never_have_one_name() -> None:
    """Without packages, Python would take the one for the other."""
    names = [file.stem for file in TESTS.rglob("*.py") if file.stem != "conftest"]
    assert sorted(set(names)) == sorted(names)


def test_every_probe_is_used() -> None:
    """By its name: some are programs of processes that tests start."""
    texts = {file: file.read_text() for file in TESTS.rglob("*.py")}
    for probe in (TESTS / "probes").glob("*.py"):
        others = (text for file, text in texts.items() if file != probe)
        assert any(probe.stem in text for text in others), probe.name
