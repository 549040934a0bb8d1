"""A matrix of mutations that goes on from an earlier run (`--resume`)."""

from __future__ import annotations

from collections import Counter

import pytest

import mitsuba_ref.mutations.__main__ as command
from mitsuba_ref.mutations.defects.catalogue import CATALOGUE
from mitsuba_ref.mutations.matrix import (
    UNCHANGED,
    Row,
    control,
    read_matrix_rows,
    write_matrix,
)
from mitsuba_ref.mutations.resumed import Matrix
from mitsuba_ref.mutations.rungs import REPLAY, Rung

THREE = CATALOGUE[:3]
NOW, OLD = "0123456789ab", "ba9876543210"


def row(name: str, scene: str, commit: str = "", harmful: bool = True) -> Row:
    seen = Rung(REPLAY, harmful, "made up", 1, 0.0)
    return Row(name, "does", harmful, scene, (seen,), 0.0, commit=commit)


def rows_of(mutations, commit):
    return [row(m.name, m.scene, commit, m.harmful) for m in mutations]


def test_missing_mutations_come_first_then_those_of_other_commits():
    first, second, third = THREE
    before = [*rows_of([first], NOW), *rows_of([second], OLD)]
    assert Matrix(before, NOW, THREE).to_try() == ([third], [second])
    assert Matrix([], NOW, THREE).to_try() == (list(THREE), [])
    # what was measured with changes that no commit holds may be anything
    for commit in (f"{NOW}-dirty", f"{OLD}-dirty", "unknown", ""):
        uncommitted = Matrix(rows_of(THREE, commit), commit, THREE)
        assert uncommitted.rows == []
        assert uncommitted.to_try() == (list(THREE), [])
        assert Matrix(rows_of(THREE, commit), NOW, THREE).rows == []


def test_an_old_row_stays_until_there_is_a_new_one():
    first = THREE[0]
    matrix = Matrix([*rows_of(THREE, OLD), row("gone", "nowhere", OLD)], NOW, THREE)
    matrix.add(row(first.name, first.scene), NOW)
    matrix.add(row(UNCHANGED, first.scene, harmful=False), NOW)
    assert [one.mutation for one in matrix.rows] == [UNCHANGED, *(m.name for m in THREE)]
    assert [one.commit for one in matrix.rows] == [NOW, NOW, OLD, OLD]
    assert len(matrix.of_this_commit) == 2


def test_a_row_of_another_scene_is_none_of_the_mutation():
    first = THREE[0]
    elsewhere = row(first.name, "another-scene", NOW)
    assert Matrix([elsewhere], NOW, THREE).to_try()[0] == list(THREE)


@pytest.fixture
def tried(monkeypatch):
    """Replace the checks; return the names of the mutations that were tried."""
    names: list[str] = []

    def try_mutation(mutation, references, broken=()):
        names.append(f"{mutation.name} {mutation.scene}")
        if len(names) == STOP[0]:
            raise KeyboardInterrupt
        return row(mutation.name, mutation.scene, harmful=mutation.harmful)

    STOP[0] = 0
    monkeypatch.setattr("mitsuba_ref.mutations.matrix.try_mutation", try_mutation)
    monkeypatch.setattr(command, "named", lambda only: THREE)
    monkeypatch.setattr(
        command.machine,
        "circumstances",
        lambda *_: {"commit": NOW, "created": "", "command": ""},
    )
    monkeypatch.setattr(command.machine, "current_commit", lambda: NOW)
    return names


STOP = [0]


def test_an_interrupted_run_goes_on(tried, tmp_path, capsys):
    """The one with an interrupt and its sequel try each mutation, and no more, once."""
    where = ["--out", str(tmp_path)]
    STOP[0] = 3
    with pytest.raises(KeyboardInterrupt):
        command.main(where)
    path = tmp_path / "matrix.json"
    half = {one.mutation for one in read_matrix_rows(path)}
    before, tried[:], STOP[0] = list(tried), [], 0
    assert command.main([*where, "--resume", str(path)]) == 0
    controls = {f"{UNCHANGED} {m.scene}" for m in THREE}
    wanted = controls | {f"{m.name} {m.scene}" for m in THREE}
    assert set(before) | set(tried) == wanted
    assert half.isdisjoint(
        name.split()[0] for name in tried if not name.startswith(UNCHANGED)
    )
    assert len(read_matrix_rows(path)) == len(wanted)
    tried.clear()
    assert command.main([*where, "--resume", str(path)]) == 0
    assert tried == []


def test_a_row_is_of_the_commit_that_it_was_measured_with(tried, tmp_path, monkeypatch):
    """Somebody commits while the matrix is made, which takes hours."""
    monkeypatch.setattr(
        command.machine, "current_commit", lambda: NOW if len(tried) < 3 else OLD
    )
    assert command.main(["--out", str(tmp_path)]) == 0
    commits = Counter(one.commit for one in read_matrix_rows(tmp_path / "matrix.json"))
    assert commits == {NOW: 2, OLD: len(tried) - 2}


@pytest.mark.parametrize(
    ("content", "said"),
    [(None, "No such file"), ('{"rows"', "truncated"), ('{"commit": "x"}', "rows")],
)
def test_what_is_no_matrix_is_refused(tmp_path, capsys, content, said):
    path = tmp_path / "matrix.json"
    if content is not None:
        path.write_text(content)
    assert command.main(["--resume", str(path), "--out", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert str(path) in error


def test_rows_without_a_commit_are_of_their_records(tmp_path):
    path = tmp_path / "matrix.json"
    write_matrix([row("one", "a"), row("two", "a", OLD)], {"commit": NOW}, path)
    assert [one.commit for one in read_matrix_rows(path)] == [NOW, OLD]


def test_a_control_is_no_mutation_of_the_catalogue():
    """Its key is apart, or a scene's control would stand for another's."""
    assert {control(m.scene).name for m in THREE} == {UNCHANGED}
    assert UNCHANGED not in {m.name for m in CATALOGUE}
