"""The harness turned around: how many scenes until a defect of ours is seen.

A mutant of our renderer renders the scenes of a seed, one after the other. It is seen by
the first scene on which the unharmed renderer takes Mitsuba's paths and the mutant not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

from mitsuba_ref.generate.judge import AGREE, STRICT, Judge
from mitsuba_ref.generate.scene import Scenes
from mitsuba_ref.mutations.mutant import Mutant
from mitsuba_ref.mutations.mutation import Mutation
from mitsuba_ref.our_renderer.picture import OurPicture, RenderOurs
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.reference.cache import RenderFunction
from renderer.scene_file.plugins import tag_of_plugin

TIME_LIMIT = 600.0
"""Seconds for a picture of a mutant: all kernels of its scene are compiled anew."""


@dataclass(frozen=True)
class Seen:
    """How a defect was seen."""

    defect: str  # name of the mutation
    scenes: int  # drawn until then
    sentence: str  # what differs; empty: not seen

    @property
    def line(self) -> str:
        """What is printed."""
        said = f"scene {self.scenes}: {self.sentence}"
        return f"{self.defect}: " + (
            said if self.sentence else f"not in {self.scenes} scenes"
        )


def may_reach(mutation: Mutation, root: Element) -> bool:
    """Tell whether a scene may run what a mutation edits: a plugin's file needs the plugin.

    Kernels of a mutant are compiled for each scene, so that scenes without it are passed
    over. (Few plugins use kernels of another's file; those scenes are passed over too.)
    """
    drawn = {element.get("type") for element in root.iter()}
    modules = {edit.symbol.partition(".")[0] for edit in mutation.edits}
    return any(tag_of_plugin(name) is None or name in drawn for name in modules)


def scenes_until_seen(
    mutation: Mutation,
    seed: int,
    most: int,
    render_ours: RenderOurs,
    render_reference: RenderFunction,
    folder: Path,
    tell: Callable[[int], None] = lambda _: None,
) -> Seen:
    """Return after how many scenes a mutation is seen.

    Parameters
    ----------
    mutation
        The defect.
    seed, most
        Of the scenes; how many are drawn at most.
    render_ours, render_reference
        The unharmed renderer, and Mitsuba.
    folder
        For files that may be overwritten.
    tell
        Is given the number of each scene.
    """
    scenes = Scenes(seed)
    unharmed = Judge(render_ours, render_reference, folder, STRICT)
    with Mutant(mutation, TIME_LIMIT) as mutant:

        def render(request: RenderRequest) -> OurPicture:
            return mutant.render(request)

        harmed = Judge(render, render_reference, folder, STRICT)
        for number in range(most):
            tell(number)
            scene = scenes.draw(number)
            if not may_reach(mutation, scene.root):
                continue
            if unharmed.judge(scene).verdict != AGREE:
                continue
            found = harmed.judge(scene)
            if found.verdict != AGREE:
                return Seen(mutation.name, number + 1, found.sentence)
    return Seen(mutation.name, most, "")
