"""The plan as a page of text for people: `--explain`."""

from __future__ import annotations

import textwrap
from itertools import chain

from renderer.advice.all_cautions import cautions_of
from renderer.process import memory
from renderer.rendering.aovs import plans_of
from renderer.rendering.goal import options_of_goal
from renderer.rendering.keywords import with_keywords
from renderer.rendering.memory_estimate import Estimate, estimate_all
from renderer.rendering.planning.explanation import TOPIC_WIDTH
from renderer.rendering.planning.plan import Plan
from renderer.rendering.render_options import OPTIONS, RenderOptions
from renderer.scene.scene import Scene

WIDTH = 92


def text_with(scene: Scene, options: RenderOptions) -> str:
    """Return what `render` would do with the same arguments, and why, as lines of text.

    Raises
    ------
    SceneError
        As `make_plan`.
    """
    planned = options_of_goal(scene, options)
    (_, plan), *colors = renders = plans_of(scene, planned)
    film = scene.description.camera.film
    size = f"{film.crop_width} x {film.crop_height} pixels"
    if (film.crop_width, film.crop_height) != (film.width, film.height):
        size += f" of {film.width} x {film.height}"
    page = [f"{scene.description.source}: {size}"]
    if given := options.given():
        listed = [f"{OPTIONS[name].flag or name} {value}" for name, value in given.items()]
        page += ["", "What is requested", *_row("-", ", ".join(listed))]
    if scene.description.simplified:
        page += ["", "What is simplified"]
        page += [line for told in scene.description.simplified for line in _row("-", told)]
    page += _sections(plan)
    for _, its_plan in colors:
        page += ["", "The colours, by the integrator inside", *_sections(its_plan)]
    page += _known_to_fail(*renders[-1])
    needs = estimate_all(renders, planned)
    page += ["", "Memory in addition to the scene", *_row("at most", _memory_text(needs))]
    return "\n".join(page) + "\n"


plan_text = with_keywords(RenderOptions, text_with, "plan_text")


def _memory_text(needs: Estimate) -> str:
    room = memory.whose_room()
    fits = "" if needs.total <= memory.room() else ", which is too little"
    return f"{memory.shown(needs.total)} ({needs}); {room}{fits}"


def _sections(plan: Plan) -> list[str]:
    rows = [(line[:TOPIC_WIDTH].strip(), line[TOPIC_WIDTH:]) for line in plan.lines]
    done = ["", "What is done"]
    for topic, text in rows:
        if topic != "left out":
            done += _row(topic, text)
        if topic == "method":
            done += _row("", plan.kind.about)
    left_out = [
        line for topic, text in rows if topic == "left out" for line in _row("-", text)
    ]
    if left_out:
        left_out = ["", "What is left out, and why", *left_out]
    return done + left_out


def _known_to_fail(scene: Scene, plan: Plan) -> list[str]:
    rows = [_row("-", str(caution)) for caution in cautions_of(scene, plan)]
    return ["", "What is known to fail here", *chain.from_iterable(rows)] if rows else []


def _row(topic: str, text: str) -> list[str]:
    column = 4 if topic == "-" else TOPIC_WIDTH + 2
    return textwrap.wrap(
        text,
        WIDTH,
        initial_indent=f"  {topic}".ljust(column),
        subsequent_indent=" " * column,
    )
