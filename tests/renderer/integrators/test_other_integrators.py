"""Integrators that only Mitsuba has: refused with what to do, and doing it renders."""

import numpy as np
import pytest
from scene_file_samples import SENSOR, error_of, scene_text

import renderer
from mitsuba_ref.reference.edited_scene import PATH_INSTEAD, load_edited_scene
from renderer.command.cli import main
from renderer.errors import SceneError
from renderer.rendering.planning.make_plan import make_plan

SMALL = SENSOR.replace(
    "</sensor>",
    '<film type="hdrfilm"><integer name="width" value="8"/>'
    '<integer name="height" value="6"/>'
    "</film></sensor>",
)
SKY = '<emitter type="constant"/>'


def text_with(integrator):
    return scene_text(integrator + SKY, sensor=SMALL)


UNKNOWN = '<integrator type="prb"><integer name="anything" value="3"/></integrator>'


def test_the_error_says_how_the_scene_is_rendered():
    scene = renderer.load_string(text_with(UNKNOWN))
    with pytest.raises(SceneError) as refused:
        renderer.render(scene)
    message = str(refused.value)
    assert message.startswith('<string>:2: integrator "prb" is not supported; supported')
    assert "--integrator path" in message
    assert 'render(scene, integrator="path")' in message


@pytest.mark.parametrize(
    "around",
    ["{}", "<integrator type='aov'><string name='aovs' value='t:depth'/>{}</integrator>"],
)
def test_path_renders_it_as_if_the_file_had_asked_for_path(around):
    asked = renderer.load_string(text_with(around.format(UNKNOWN)))
    path = renderer.load_string(text_with('<integrator type="path"/>'))
    image = renderer.render(asked, integrator="path", spp=2)
    np.testing.assert_array_equal(
        image.pixels, renderer.render(path, integrator="path", spp=2).pixels
    )


@pytest.mark.parametrize(
    ("depth", "around"),
    [
        (3, "{}"),
        (3, "<integrator type='aov'><string name='aovs' value='t:depth'/>{}</integrator>"),
        (-7, "{}"),  # may mean something else there
    ],
)
def test_what_all_path_tracers_have_is_kept(depth, around):
    given = f"""<integrator type="prb"><integer name="max_depth" value="{depth}"/>
<integer name="rr_depth" value="2"/><boolean name="hide_emitters" value="true"/>
</integrator>"""
    scene = renderer.load_string(text_with(around.format(given)))
    plan = make_plan(scene, integrator="path")
    path = '<integrator type="path"/>' if depth < 0 else given.replace("prb", "path")
    expected = make_plan(renderer.load_string(text_with(path)), integrator="path")
    assert (plan.max_depth, plan.hide_emitters) == (
        expected.max_depth,
        expected.hide_emitters,
    )
    inner = scene.description.integrator.nested or scene.description.integrator
    assert inner.rr_depth == (5 if depth < 0 else 2)


def test_of_a_scene_with_media_volpath_is_named():
    media = """<shape type="sphere"><bsdf type="null"/>
<medium type="homogeneous" name="interior"/></shape></scene>"""
    text = text_with('<integrator type="prbvolpath"/>').replace("</scene>", media)
    scene = renderer.load_string(text)
    assert scene.description.warnings == ()  # such as that it ignores them
    with pytest.raises(SceneError, match="--integrator volpath, or in Python"):
        renderer.render(scene)


def test_a_dictionary_names_it_as_integrator():
    content = {
        "type": "scene",
        "integrator": {"type": "prb_volpath"},
        "s": {"type": "perspective"},
    }
    with pytest.raises(SceneError, match='integrator "prb_volpath" is not supported'):
        renderer.render(renderer.load_dict(content))


def test_the_command_line_does_so(tmp_path, capsys):
    file, picture = tmp_path / "scene.xml", tmp_path / "a.npy"
    file.write_text(text_with(UNKNOWN))
    assert main([str(file), "-o", str(picture)]) == 1
    assert "--integrator path" in capsys.readouterr().err
    assert main([str(file), "-o", str(picture), "--integrator", "path"]) == 0
    assert np.load(picture).mean() > 0.1


@pytest.mark.parametrize("plugin", ["volpath", "volpathmis"])
def test_paths_through_volumes_are_paths_where_there_are_none(plugin):
    text = text_with(
        f'<integrator type="{plugin}"><integer name="max_depth" value="3"/>'
        '<integer name="rr_depth" value="7"/></integrator>'
    )
    scene = renderer.load_string(text)
    mine = scene.description.integrator
    assert (mine.name, mine.max_depth, mine.rr_depth) == ("volpath", 3, 7)
    plan = make_plan(scene)
    assert plan.method == "path"
    assert "path: without media" in "\n".join(plan.lines)
    assert error_of(f'<integrator type="{plugin}"><float name="x" value="1"/></integrator>')


def test_by_default_both_are_the_same_picture():
    """Bit for bit, by the same kernels: their weights differ in a replay alone."""
    media = """<shape type="sphere"><bsdf type="null"/>
<medium type="homogeneous" name="interior"><rgb name="sigma_t" value="0.9, 0.5, 0.2"/>
</medium></shape></scene>"""
    volpath, volpathmis = (
        renderer.load_string(
            text_with(f'<integrator type="{plugin}"/>').replace("</scene>", media)
        )
        for plugin in ("volpath", "volpathmis")
    )
    assert make_plan(volpath) == make_plan(volpathmis)
    np.testing.assert_array_equal(
        renderer.render(volpath, spp=4).pixels, renderer.render(volpathmis, spp=4).pixels
    )


@pytest.mark.parametrize("bsdf", ["null", "mask", "thindielectric"])
def test_they_are_not_where_their_shadow_rays_see_through_something(bsdf):
    nested = '<bsdf type="diffuse"/>' if bsdf == "mask" else ""
    text = text_with('<integrator type="volpath"/>').replace(
        "</scene>",
        f'<shape type="sphere"><bsdf type="{bsdf}">{nested}</bsdf></shape></scene>',
    )
    assert make_plan(renderer.load_string(text)).method == "volpath"


def test_an_integrator_that_ignores_media_says_so():
    text = text_with('<integrator type="path"/>').replace(
        "</scene>",
        '<shape type="sphere"><bsdf type="null"/>'
        '<medium type="homogeneous" name="interior"/></shape></scene>',
    )
    (warning,) = renderer.load_string(text).description.warnings
    assert "ignores the scene's media, as in Mitsuba; volpath does not" in warning


def test_a_file_without_an_integrator_is_compared_by_path(tmp_path):
    """Mitsuba reads it and does not render it; the reference gets our default."""
    path = tmp_path / "scene.xml"
    path.write_text(text_with(""))
    edited = load_edited_scene(path, {}, fixed_blocks=True)
    assert edited.integrator == "path"
    assert PATH_INSTEAD in edited.changes
    assert "PathIntegrator" in str(edited.scene.integrator())
    path.write_text(text_with('<integrator type="direct"/>'))
    edited = load_edited_scene(path, {}, fixed_blocks=True)
    assert edited.integrator == "direct"
    assert PATH_INSTEAD not in edited.changes
