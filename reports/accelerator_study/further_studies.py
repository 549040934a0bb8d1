"""Studies with a section of their own on the page "accelerators"; one line adds one.

Each measures something that JSON can hold, and draws a section from that alone, so that
`--from` draws an old record again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from reports.bounding_volume_study.section import bounding_volume_section
from reports.bounding_volume_study.study import bounding_volume_study
from reports.moving_scene.section import moving_scene_section
from reports.moving_scene.study import measure_moving_scene


class FurtherStudy(NamedTuple):
    """How one study is measured and drawn."""

    title: str
    measure: Callable[[bool], Any]  # whether it is the quick one -> what JSON can hold
    # what was measured -> the section as HTML, without its title
    section: Callable[[Any], str]


# key in accelerators.json and id on the page -> the study; shown in this order
FURTHER_STUDIES: dict[str, FurtherStudy] = {
    "bounding-volumes": FurtherStudy(
        "Bounding volumes",
        lambda quick: bounding_volume_study(repeats=200 if quick else 2000),
        bounding_volume_section,
    ),
    "moving-scene": FurtherStudy(
        "Moving scenes: refit or rebuild", measure_moving_scene, moving_scene_section
    ),
}
