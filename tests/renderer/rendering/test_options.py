"""Each option of a render is declared once; everything else is derived from that."""

from __future__ import annotations

import dataclasses
import inspect

import pytest

import renderer
from renderer.command.options import make_parser, render_options
from renderer.command.plan_text import plan_text
from renderer.errors import SceneError
from renderer.rendering.keywords import with_keywords
from renderer.rendering.render_options import DEFAULTS, OPTIONS, RenderOptions, names_of

SCENE = renderer.load_dict({"type": "scene", "sensor": {"type": "perspective"}})
FUNCTIONS = [renderer.render, renderer.render_frames, renderer.render_to_file]
OF_PYTHON_ALONE = {"progress", "live", "measured_camera", "metadata", "mitsuba_version"}
# a value of each option that is not its default, and the word of the command line
GIVEN = {
    "spp": (7, "7"),
    "seed": (3, "3"),
    "threads": (2, "2"),
    "integrator": ("path", "path"),
    "accel": ("bvh", "bvh"),
    "sampler": ("sobol", "sobol"),
    "ray_offset": ("mitsuba", "mitsuba"),
    "target_error": (0.02, "2%"),
    "time_limit": (5.0, "5s"),
    "checkpoint": ("a.ckpt", "a.ckpt"),
    "checkpoint_every": (9.0, "9"),
    "cluster": ("local:2", "local:2"),
    "memory": (4 << 30, "4GiB"),
    "light_choice": ("uniform", "uniform"),
}


@pytest.mark.parametrize("function", FUNCTIONS)
def test_every_option_is_an_argument_with_its_default_and_its_help(function):
    parameters = inspect.signature(function).parameters
    found = {name: p.default for name, p in parameters.items() if name in OPTIONS}
    assert list(found) == list(OPTIONS) and found == DEFAULTS
    for name, option in OPTIONS.items():
        assert f"\n    {name} : " in function.__doc__
        assert option.help.split()[1] in function.__doc__


def test_samples_and_seed_are_the_first_two_arguments():
    """Programs give these by position."""
    assert list(OPTIONS)[:2] == ["spp", "seed"]


def test_every_option_is_on_the_command_line_or_of_python_alone():
    assert {name for name, option in OPTIONS.items() if not option.flag} == OF_PYTHON_ALONE
    assert set(GIVEN) == set(OPTIONS) - OF_PYTHON_ALONE - {"resume", "denoise"}
    text = " ".join(make_parser().format_help().split())
    for option in OPTIONS.values():
        assert option.flag in text


@pytest.mark.parametrize("name", GIVEN)
def test_words_of_the_command_line_become_the_option(name):
    """And `--explain` repeats what is given, whichever option it is."""
    value, word = GIVEN[name]
    flag = OPTIONS[name].flag
    options = render_options(make_parser().parse_args(["a.xml", f"{flag}={word}"]))
    assert options.given().keys() == {name}
    assert str(getattr(options, name)) == str(value)
    assert f"{flag} {value}" in plan_text(SCENE, **vars(options))


def test_without_words_all_options_are_at_their_defaults():
    assert render_options(make_parser().parse_args(["a.xml"])) == RenderOptions()
    assert "What is requested" not in plan_text(SCENE)


def test_a_new_option_is_one_field():
    """It is an argument, documented, checked and repeated without another line."""
    more = dataclasses.make_dataclass(
        "More", [("gain", "float", 1.0)], bases=(RenderOptions,), frozen=True
    )
    gained = with_keywords(more, lambda scene, options: options.gain, "gained")
    assert gained(SCENE) == 1.0 and gained(SCENE, 4, gain=2.0) == 2.0
    assert inspect.signature(gained).parameters["gain"].default == 1.0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            {"sped": 4},
            "render(): got an unexpected keyword argument 'sped'; did you mean ",
        ),
        ({"integrater": "path"}, "did you mean integrator?"),
    ],
)
def test_an_unknown_argument_names_the_nearest(arguments, words):
    with pytest.raises(TypeError) as caught:
        renderer.render(SCENE, **arguments)
    assert words in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("name", sorted(set(OPTIONS) - set(names_of("bands"))))
def test_what_needs_the_whole_film_is_refused_for_bands(name, tmp_path):
    values = {name: value for name, (value, _) in GIVEN.items()}
    values |= {"measured_camera": [0.0] * 6, "resume": True, "denoise": True, "live": True}
    given = {name: values[name]} | ({"checkpoint": "a"} if name == "resume" else {})
    with pytest.raises(SceneError, match="needs the whole film in memory"):
        renderer.render_to_file(SCENE, tmp_path / "a.exr", **given)


def test_own_metadata_stands_in_the_picture():
    image = renderer.render(SCENE, 1, metadata={"shot": "12"})
    assert image.metadata["shot"] == "12"


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("spp", True),
        ("seed", 1.5),
        ("resume", "no"),
        ("metadata", 5),
        ("metadata", {1: 2}),
        ("measured_camera", 5),
        ("measured_camera", [1.0, 2.0]),
        ("measured_camera", [float("nan")] * 6),
    ],
)
def test_a_value_of_a_wrong_type_is_refused_before_anything_is_rendered(name, value):
    with pytest.raises(TypeError, match=f"{name} is .*possible"):
        RenderOptions(**{name: value})


def test_a_sweep_names_what_is_no_scene_after_the_pictures_before_it():
    ball = {"type": "scene", "sensor": {"type": "perspective"}, "a": {"type": "constant"}}
    ball["sensor"]["film"] = {"type": "hdrfilm", "width": 4, "height": 4}
    images = renderer.render_frames([renderer.load_dict(ball), None], spp=1)
    assert next(images).pixels.shape == (4, 4, 3)
    with pytest.raises(TypeError, match="the scene is None"):
        next(images)
