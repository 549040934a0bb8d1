"""The motions of `studies.moving_scene`, as `limits` names them."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from reports.studies import moving_scene
from reports.trials.meshes import StudyMesh


class Motion(NamedTuple):
    """One way to move."""

    name: str
    about: str
    move: Callable[..., moving_scene.Corners]

    def at(self, rest: StudyMesh, progress: float) -> StudyMesh:
        """Return the mesh on its way."""
        return moving_scene.moved(rest, self.move, progress)


MOTIONS = tuple(
    Motion(move.__name__, about, move) for about, move in moving_scene.MOTIONS.items()
)
