"""The notebooks in docs/notebooks: kept without outputs, and each runs from top to bottom.

They run as plain Python here, cell after cell, with small pictures: Jupyter is not needed.
What a cell would show is made too, since a figure that cannot be drawn fails only there.
"""

from __future__ import annotations

import ast
import json
import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

import renderer
from renderer.plugins.bsdfs.registry import BSDFS

FOLDER = Path(__file__).parents[2] / "docs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
# what the cell "parameters" says, in small; at least 32 pixels, which a comparison needs
SMALL = {"WIDTH": 40, "HEIGHT": 33, "SPP": 16, "RINGS": 12, "TRUTH": 64}

each = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)


def cells(path, kind="code"):
    """Return the cells of a kind as (text, tags)."""
    found = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return [
        ("".join(cell["source"]), cell["metadata"].get("tags", []))
        for cell in found
        if cell["cell_type"] == kind
    ]


def test_there_is_one_for_each_chapter():
    """Six, numbered in the order of the lecture."""
    assert [path.name[:2] for path in NOTEBOOKS] == [f"{k}-" for k in range(1, 7)]


@each
def test_a_notebook_is_kept_without_outputs(path):
    """Outputs make a diff unreadable, and hold paths of the writer's machine."""
    notebook = json.loads(path.read_text(encoding="utf-8"))
    assert (notebook["nbformat"], notebook["nbformat_minor"]) == (4, 5)
    ids = [cell["id"] for cell in notebook["cells"]]
    assert len(set(ids)) == len(ids)
    for cell in notebook["cells"]:
        assert cell["cell_type"] in ("code", "markdown")
        if cell["cell_type"] == "code":
            assert cell["outputs"] == [] and cell["execution_count"] is None
    assert not re.search(r"/(home|root|tmp|work|Users)/", path.read_text(encoding="utf-8"))


@each
def test_a_notebook_says_what_is_learned_and_ends_with_a_proof(path):
    """The first text has a list; the last cell compares, or says what is missing."""
    first = cells(path, "markdown")[0][0]
    assert first.startswith(f"# {path.name[0]}. ") and "\nYou learn here\n- " in first
    last, _ = cells(path)[-1]
    assert "renderer_compare(" in last and "Mitsuba is not installed" in last


@each
def test_a_notebook_uses_the_public_names_of_the_renderer(path):
    """`renderer.NAME` is what a student copies."""
    found = re.findall(r"\brenderer\.(\w+)\(", "\n".join(text for text, _ in cells(path)))
    assert found and set(found) <= set(renderer.__all__)


@each
def test_the_exercises_that_a_notebook_names_exist(path):
    """`lightproof exercise NAME` and `lightproof check NAME.py` are of one exercise."""
    registry = pytest.importorskip("renderer.exercises.registry")
    text = "\n".join(text for text, _ in cells(path, "markdown"))
    named = re.findall(r"`lightproof exercise (\w+)`", text)
    assert named and set(named) <= set(registry.EXERCISES)
    assert named == re.findall(r"`lightproof check (\w+)\.py`", text)


@pytest.fixture
def own_bsdfs_forgotten():
    """Take out what a notebook registers: other tests count the plugins."""
    before = set(BSDFS)
    yield
    for name in set(BSDFS) - before:
        del BSDFS[name]


@each
@pytest.mark.usefixtures("own_bsdfs_forgotten")
def test_a_notebook_runs(path, capsys, monkeypatch):
    """From top to bottom with small pictures, the verdict against Mitsuba included."""
    module = ModuleType("__main__")  # without a file, as in Jupyter
    monkeypatch.setitem(sys.modules, "__main__", module)
    names = vars(module)
    for number, (text, tags) in enumerate(cells(path)):
        shown = run_cell(text, f"{path.name}, cell {number}", names)
        if "parameters" in tags:
            names.update({name: SMALL[name] for name in names if name in SMALL})
        for form in ("to_json", "_repr_html_"):
            if hasattr(shown, form):
                assert getattr(shown, form)()
    printed = capsys.readouterr().out
    assert "do not differ by more than noise" in printed


def run_cell(text, name, names):
    """Execute a cell; return the value of its last line, as a notebook shows it."""

    def run(tree, mode):
        # without this file's own `from __future__ import annotations`
        return eval(compile(tree, name, mode, dont_inherit=True), names)

    tree = ast.parse(text, name)
    if not isinstance(tree.body[-1], ast.Expr):
        return run(tree, "exec")
    last = tree.body.pop()
    run(tree, "exec")
    return run(ast.Expression(last.value), "eval")
