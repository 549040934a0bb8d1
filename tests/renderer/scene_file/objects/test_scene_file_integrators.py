"""Integrators: Mitsuba's defaults, counts and aov lists, and one error for each fault."""

from __future__ import annotations

import re

import pytest
from scene_file_samples import error_of, mitsuba_refuses, ours, theirs
from scene_xml import props

from renderer.scene_file.description import AOV_KINDS, Integrator

TEXT = '<integrator type="{}">\n{}</integrator>'


def integrator(plugin: str, content: str = "") -> Integrator:
    return ours(TEXT.format(plugin, content)).integrator


def shown(plugin: str, content: str = "") -> dict[str, int]:
    """Return the numbers that Mitsuba prints of its integrator."""
    text = str(theirs(TEXT.format(plugin, content)).integrator())
    return {name: int(number) for name, number in re.findall(r"(\w+) = (\d+)", text)}


def integer(name: str, value: int) -> str:
    return f'<integer name="{name}" value="{value}"/>'


@pytest.mark.parametrize(
    "content",
    ["", integer("max_depth", 3), integer("max_depth", 0), integer("rr_depth", 9)],
)
def test_path_depths_are_those_of_mitsuba(content: str) -> None:
    mine, expected = integrator("path", content), shown("path", content)
    assert mine.max_depth % 2**32 == expected["max_depth"]  # -1 is shown unsigned
    assert mine.rr_depth == expected["rr_depth"]
    assert not mine.hide_emitters


@pytest.mark.parametrize(
    "content",
    [
        "",
        integer("emitter_samples", 3),
        integer("bsdf_samples", 0),
        integer("emitter_samples", 0),
        integer("emitter_samples", 1) + integer("bsdf_samples", 2),
        integer("shading_samples", 4),
    ],
)
def test_direct_counts_are_those_of_mitsuba(content: str) -> None:
    mine, expected = integrator("direct", content), shown("direct", content)
    assert mine.emitter_samples == expected["emitter_samples"]
    assert mine.bsdf_samples == expected["bsdf_samples"]
    assert mine.max_depth == 2


def test_scene_without_integrator_has_mitsubas_default() -> None:
    assert ours("").integrator == Integrator() == integrator("path")


@pytest.mark.parametrize("plugin", ["path", "direct", "depth", "whitted"])
def test_hide_emitters_and_work_properties_are_taken(plugin: str) -> None:
    content = (
        props(hide_emitters=True, timeout=-1.0)
        + integer("block_size", 8)
        + integer("samples_per_pass", 4)
    )
    mine = integrator(plugin, content)
    assert mine.name == plugin
    assert mine.hide_emitters == (plugin != "depth")
    if plugin != "whitted":
        theirs(TEXT.format(plugin, content))


def test_whitted_has_its_own_defaults() -> None:
    mine = integrator("whitted")
    assert (mine.max_depth, mine.cutoff, mine.hide_emitters) == (8, 1 / 1024, False)
    mine = integrator("whitted", integer("max_depth", 3) + props(cutoff=0.5))
    assert (mine.max_depth, mine.cutoff) == (3, 0.5)


def test_aov_list_with_all_kinds_and_a_nested_integrator() -> None:
    entries = ", ".join(f"my_{kind}:{kind}" for kind in AOV_KINDS)
    content = f'<string name="aovs" value="{entries}"/>' + TEXT.format(
        "path", integer("max_depth", 5)
    )
    mine = integrator("aov", content)
    assert mine.aovs == tuple((f"my_{kind}", kind) for kind in AOV_KINDS)
    assert mine.nested == integrator("path", integer("max_depth", 5))
    names = theirs(TEXT.format("aov", content)).integrator().aov_names()
    prefixes = dict.fromkeys(name.partition(".")[0] for name in names)
    assert [name for name in prefixes if name.startswith("my_")] == [
        n for n, _ in mine.aovs
    ]


def test_aov_alone_has_no_nested_integrator() -> None:
    mine = integrator("aov", props(aovs="dd:depth nn:sh_normal"))
    assert mine.nested is None
    assert mine.aovs == (("dd", "depth"), ("nn", "sh_normal"))


# -------------------------------------------------------------------- errors


def aovs(text: str) -> str:
    return f'<string name="aovs" value="{text}"/>'


@pytest.mark.parametrize(
    ("plugin", "content", "message"),
    [
        (
            "volpath",
            integer("depth", 1),
            'integrator "volpath" has no property "depth"; supported: max_depth, rr_depth',
        ),
        ("path", integer("max_depth", -2), "found -2, expected at least -1"),
        ("path", integer("rr_depth", 0), "found 0, expected at least 1"),
        ("path", props(max_depth=3.0), "a value of type float, expected integer"),
        (
            "path",
            integer("bsdf_samples", 2),
            'has no property "bsdf_samples"; supported: max_d',
        ),
        (
            "direct",
            integer("max_depth", 2),
            'has no property "max_depth"; supported: shading_s',
        ),
        (
            "depth",
            integer("max_depth", 2),
            'has no property "max_depth"; supported: hide_emitt',
        ),
        (
            "direct",
            integer("shading_samples", 2) + integer("bsdf_samples", 0),
            'found a value together with "shading_samples", expected one of the two',
        ),
        (
            "aov",
            "",
            'property "aovs": found nothing, expected a list like "dd:depth, nn:sh_no',
        ),
        (
            "aov",
            aovs("dd:foo"),
            'found "dd:foo", expected name:kind with a kind of albedo, de',
        ),
        ("aov", aovs("dd:Depth"), 'found "dd:Depth", expected name:kind'),
    ],
)
def test_integrators_that_are_wrong(plugin: str, content: str, message: str) -> None:
    text = TEXT.format(plugin, content)
    assert error_of(text).startswith(("<string>:2: ", "<string>:3: "))
    assert message in error_of(text)
    assert mitsuba_refuses(text)


@pytest.mark.parametrize(
    ("plugin", "content", "message"),
    [
        ("path", props(timeout=3.0), "found 3 s, expected none"),
        ("whitted", props(cutoff=0.0), "found 0, expected above 0"),
        ("aov", aovs("depth"), 'found "depth", expected name:kind'),  # Mitsuba crashes
        ("aov", aovs(":depth"), 'found ":depth", expected name:kind'),  # Mitsuba crashes
        ("aov", aovs(""), "an empty list"),
        ("aov", aovs("a:depth a:uv"), 'the name "a" twice'),
        ("aov", aovs("a:dp_du"), 'found "a:dp_du", expected name:kind'),
        ("aov", aovs("a:uv") + TEXT.format("aov", aovs("b:uv")), "inside of another one"),
        (
            "aov",
            aovs("a:uv") + TEXT.format("path", "") + TEXT.format("direct", ""),
            "a second <integrator> in integrator",
        ),
    ],
)
def test_integrators_that_only_we_refuse(plugin: str, content: str, message: str) -> None:
    assert message in error_of(TEXT.format(plugin, content))


def test_supported_lists_name_every_property() -> None:
    """The list in the message comes from what the reader looks for; here, all of it."""
    message = error_of(TEXT.format("path", integer("nope", 1)))
    assert message == (
        '<string>:3: integrator "path" has no property "nope"; '
        "supported: max_depth, rr_depth, "
        "hide_emitters, block_size, samples_per_pass, timeout"
    )


def test_no_samples_at_all_are_refused() -> None:
    """Neither of lights nor of the BSDF: Mitsuba refuses these too."""
    none = integer("emitter_samples", 0) + integer("bsdf_samples", 0)
    with pytest.raises(RuntimeError, match="at least 1"):
        shown("direct", none)
    message = error_of(TEXT.format("direct", none))
    assert 'property "bsdf_samples": found 0 together with "emitter_samples" 0' in message
    assert "expected 1 or more of either" in message
