"""proof.toml: every key is checked, so that a typing error is never a default."""

from __future__ import annotations

import pytest
from mitsuba_stand_in import write_scene

from mitsuba_ref.records.proof_file import NO_PROOF, read_proof
from renderer.errors import SceneError


@pytest.fixture
def scene(tmp_path):
    return write_scene(tmp_path, width=12, height=9, spp=5)


def edit(scene, old: str, new: str) -> None:
    proof = scene.with_name("proof.toml")
    text = proof.read_text()
    assert old in text
    proof.write_text(text.replace(old, new, 1))


def test_a_complete_file(scene):
    proof = read_proof(scene)
    assert proof.title == "A sphere on a plane"
    assert proof.rmse_factor == 1.25
    assert proof.size("test").parameters == {"width": "12", "height": "9", "spp": "5"}
    assert proof.size("demo").width == 32


def test_without_a_file_the_scene_decides(scene):
    scene.with_name("proof.toml").unlink()
    assert read_proof(scene) == NO_PROOF
    assert read_proof(scene).size("demo") is None


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("title", "titel", "unknown field `titel`; known: title, "),
        ("[demo]", "colour = 1\n[demo]", "unknown field `colour`; known: "),
        ("width = 32", "wdth = 32", r"\[demo\]: .* unknown field `wdth`; known: width, "),
        ("width = 32", 'width = "32"', r"\[demo\]: width = '32'; Expected `int`"),
        ("width = 32", "width = 0", r"\[demo\]: width = 0; Expected `int` >= 1"),
        ("width = 32", "width = true", r"\[demo\]: width = True; Expected `int`"),
        (
            "rmse_factor = 1.25",
            "rmse_factor = 0.5",
            r"\[tolerance\]: rmse_factor = 0.5; Expected `float` >= 1",
        ),
        (
            "rmse_factor = 1.25",
            "rmse_factor = nan",
            r"rmse_factor = nan; Expected `float` >= 1",
        ),
        (
            "reason = ",
            "season = ",
            r"\[tolerance\]: .* `season`; known: rmse_factor, reason",
        ),
        (
            "deterministic = false",
            'deterministic = "no"',
            "deterministic = .no.; Expected `bool",
        ),
        ("[test]", "[test", "not a readable TOML file"),
        ("title = ", "# ", "missing required field `title`"),
        ("width = 32", "", r"\[demo\]: .* missing required field `width`"),
        ("reason = ", "# ", r"\[tolerance\]: .* missing required field `reason`"),
    ],
)
def test_what_is_wrong_is_one_line_that_names_it(scene, old, new, message):
    edit(scene, old, new)
    with pytest.raises(SceneError, match=message) as caught:
        read_proof(scene)
    assert "proof.toml" in str(caught.value)
    assert "\n" not in str(caught.value)
