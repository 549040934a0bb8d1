"""What no picture needs: read, so that its errors show, but it need not be supported."""

from __future__ import annotations

import pytest
from scene_file_samples import error_of, mitsuba_refuses, ours

BALL = '<shape type="sphere"/>'
POLARIZED = '<bsdf type="measured_polarized" id="h"/>'
BALL_OF_IT = '<shape type="sphere"><bsdf type="measured_polarized"/></shape>'
GROUP = f'<shape type="shapegroup" id="g">{BALL_OF_IT}</shape>'
NAMED = 'bsdf "measured_polarized"'
PHASE = """<phase type="sggx" id="s"><volume name="S" type="constvolume">
<float name="value" value="1"/></volume></phase>"""
UNUSED = {
    POLARIZED: NAMED,
    '<bsdf type="twosided" id="t"><bsdf type="measured_polarized"/></bsdf>': NAMED,
    PHASE: 'phase "sggx"',
    '<film type="specfilm" id="f"/>': 'film "specfilm"',
    GROUP: NAMED,
}


@pytest.mark.parametrize("content", UNUSED)
def test_what_nothing_uses_need_not_be_supported(content: str) -> None:
    """Mitsuba has it and renders the scene; so do we, and say what is left out."""
    scene = ours(BALL + content)
    assert len(scene.shapes) == 1 and not scene.groups
    (warning,) = scene.warnings
    assert f"{UNUSED[content]}" in warning and "is not supported" in warning
    assert warning.endswith("nothing uses it, so it is left out")


def test_it_is_mitsuba_that_renders_it() -> None:
    assert not mitsuba_refuses(BALL + PHASE)


@pytest.mark.parametrize("second", ["irradiancemeter", "batch"])
def test_only_the_first_camera_need_be_supported(second: str) -> None:
    first = '<sensor type="perspective"/>'
    scene = ours(BALL, sensor=first + f'<sensor type="{second}"/>')
    assert len(scene.warnings) == 2
    assert f'sensor "{second}" is not supported' in scene.warnings[0]
    assert "2 sensors; the first one takes the picture" in scene.warnings[1]
    other = f'<sensor type="{second}"/>' + first
    assert f'sensor "{second}" is not supported' in error_of(BALL, sensor=other)


@pytest.mark.parametrize(
    "content",
    [
        POLARIZED + '<shape type="sphere"><ref id="h"/></shape>',
        BALL_OF_IT,
        GROUP + '<shape type="instance"><ref id="g"/></shape>',
    ],
)
def test_what_is_used_is_refused(content: str) -> None:
    assert f"{NAMED} is not supported" in error_of(content)


def test_what_is_wrong_is_refused_whether_it_is_used_or_not() -> None:
    """As in Mitsuba."""
    wrong = '<bsdf type="diffuse" id="d"><rgb name="reflectance" value="2"/></bsdf>'
    assert "expected a reflectance in [0, 1]" in error_of(BALL + wrong)
    assert mitsuba_refuses(BALL + wrong)
