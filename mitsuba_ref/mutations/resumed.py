"""A matrix that goes on where an earlier run stopped: all of it takes hours."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from mitsuba_ref.mutations.matrix import UNCHANGED, Row
from mitsuba_ref.mutations.mutation import Mutation

Key = tuple[str, str]  # mutation and scene


class Matrix:
    """The newest row of each mutation, of this commit or of an older one.

    Parameters
    ----------
    before
        Rows of earlier runs, each with its commit. Rows of mutations that are not in
        `mutations` are dropped, and so are rows measured with uncommitted sources.
    commit
        Of the sources at the start.
    mutations
        The mutations of the catalogue to measure.
    """

    def __init__(
        self, before: Iterable[Row], commit: str, mutations: Sequence[Mutation]
    ) -> None:
        self._commit = commit
        self._mutations = mutations
        scenes = dict.fromkeys(m.scene for m in mutations)
        asked: list[Key] = [(UNCHANGED, scene) for scene in scenes]
        asked += [(m.name, m.scene) for m in mutations]
        there = {(row.mutation, row.scene): row for row in before if _committed(row.commit)}
        self._rows = {key: there.get(key) for key in asked}

    @property
    def rows(self) -> list[Row]:
        """All that there are: the unchanged renderer on each scene, then the mutations."""
        return [row for row in self._rows.values() if row]

    @property
    def of_this_commit(self) -> list[Row]:
        """Those that need not be tried again."""
        if not _committed(self._commit):
            return []
        return [row for row in self.rows if row.commit == self._commit]

    def to_try(self) -> tuple[list[Mutation], list[Mutation]]:
        """Return the mutations without a row, and those with one of another commit."""
        there = {row.mutation for row in self.rows}
        done = {row.mutation for row in self.of_this_commit}
        return (
            [m for m in self._mutations if m.name not in there],
            [m for m in self._mutations if m.name in there - done],
        )

    def add(self, row: Row, commit: str) -> None:
        """Put a new row in its place, of the commit whose sources it was measured with."""
        self._rows[row.mutation, row.scene] = replace(row, commit=commit)


def _committed(commit: str) -> bool:
    return bool(commit) and not commit.endswith(("-dirty", "unknown"))
