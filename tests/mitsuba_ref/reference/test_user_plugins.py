"""`--plugins FILE.py`: a user's BSDF in Mitsuba's process, and in the name of its picture.

The BSDF of these tests is diffuse by another name, written in Python for Mitsuba: its
picture must be that of Mitsuba's own, path by path.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from mitsuba_ref.command.cli import main
from mitsuba_ref.our_renderer.picture import read_scene
from mitsuba_ref.records.options import Options, scene_request
from mitsuba_ref.records.proof_file import NO_PROOF
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.reference.cache import ReferenceCache, entry_name
from mitsuba_ref.reference.errors import MitsubaError
from mitsuba_ref.reference.picture_process import MitsubaWorker
from renderer.errors import PluginError, SceneError
from renderer.scene_file.plugins import import_plugin_file

SCENE = """<scene version="3.0.0">
  <integrator type="path"><integer name="max_depth" value="3"/></integrator>
  <sensor type="perspective">
    <transform name="to_world">
      <lookat origin="0, 3, 3" target="0, 0, 0" up="0, 1, 0"/>
    </transform>
    <film type="hdrfilm">
      <integer name="width" value="8"/><integer name="height" value="6"/>
      <rfilter type="box"/>
    </film>
    <sampler type="independent"><integer name="sample_count" value="4"/></sampler>
  </sensor>
  <emitter type="constant"><rgb name="radiance" value="1, 0.8, 0.5"/></emitter>
  <shape type="sphere">
    <bsdf type="BSDF"><rgb name="reflectance" value="0.2, 0.5, 0.8"/></bsdf>
  </shape>
  <shape type="rectangle">
    <transform name="to_world"><rotate x="1" angle="-90"/><scale value="4"/></transform>
    <bsdf type="BSDF"><rgb name="reflectance" value="0.6, 0.5, 0.4"/></bsdf>
  </shape>
</scene>
"""

PLUGINS = '''
"""Lambert's BRDF, k_d / pi, sampled by the cosine."""


def register_mitsuba():
    import mitsuba as mi

    class PlainDiffuse(mi.BSDF):
        def __init__(self, props):
            super().__init__(props)
            self.reflectance = props.get_texture("reflectance", 0.5)
            self.m_components = [mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide]
            self.m_flags = self.m_components[0]

        def sample(self, ctx, si, sample1, sample2, active=True):
            sampled = mi.BSDFSample3f()
            cos_i = mi.Frame3f.cos_theta(si.wi)
            if cos_i <= 0.0:
                return sampled, mi.Color3f(0.0)
            sampled.wo = mi.warp.square_to_cosine_hemisphere(sample2)
            sampled.pdf = mi.warp.square_to_cosine_hemisphere_pdf(sampled.wo)
            sampled.eta = 1.0
            sampled.sampled_type = int(mi.BSDFFlags.DiffuseReflection)
            sampled.sampled_component = 0
            return sampled, self.reflectance.eval(si)

        def eval(self, ctx, si, wo, active=True):
            return self.eval_pdf(ctx, si, wo)[0]

        def pdf(self, ctx, si, wo, active=True):
            return self.eval_pdf(ctx, si, wo)[1]

        def eval_pdf(self, ctx, si, wo, active=True):
            if mi.Frame3f.cos_theta(si.wi) <= 0.0 or mi.Frame3f.cos_theta(wo) <= 0.0:
                return mi.Color3f(0.0), 0.0
            density = mi.warp.square_to_cosine_hemisphere_pdf(wo)
            return self.reflectance.eval(si) * density, density

    mi.register_bsdf("plain_diffuse", PlainDiffuse)
'''


@pytest.fixture
def plugins(tmp_path) -> Path:
    path = tmp_path / "plain_diffuse.py"
    path.write_text(PLUGINS)
    return path


def request_of(folder: Path, bsdf: str, plugins: Path | None = None) -> RenderRequest:
    path = folder / f"{bsdf}.xml"
    path.write_text(SCENE.replace("BSDF", bsdf))
    return scene_request(path, NO_PROOF, Options(plugins=plugins, threads=2))


def test_a_bsdf_of_the_users_renders_as_mitsubas_own(tmp_path, plugins):
    """The same random numbers in the same order: equal but for rounding."""
    with MitsubaWorker(120.0) as worker:
        references = ReferenceCache(worker.render, tmp_path / "references")
        mine = references.get(request_of(tmp_path, "plain_diffuse", plugins), [])
        own = references.get(request_of(tmp_path, "diffuse"), [])
    assert np.ptp(own.pixels) > 0.1
    np.testing.assert_allclose(mine.pixels, own.pixels, rtol=1e-5)


def test_without_the_file_mitsuba_does_not_know_the_plugin(tmp_path):
    with MitsubaWorker(120.0) as worker:
        references = ReferenceCache(worker.render, tmp_path / "references")
        with pytest.raises(MitsubaError, match="plain_diffuse"):
            references.get(request_of(tmp_path, "plain_diffuse"), [])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("def register_mitsuba(): raise KeyError('albedo')", "KeyError: 'albedo'"),
        ("import no_such_module", "No module named 'no_such_module'"),
    ],
)
def test_a_mistake_in_the_file_is_named_with_the_file(tmp_path, plugins, text, said):
    """In Mitsuba's process, which goes on with the next scene."""
    plugins.write_text(text)
    with MitsubaWorker(120.0) as worker:
        references = ReferenceCache(worker.render, tmp_path / "references")
        with pytest.raises(PluginError, match=said) as caught:
            references.get(request_of(tmp_path, "diffuse", plugins), [])
    assert f"{plugins}:1: " in str(caught.value)


def test_our_side_imports_the_file_before_it_reads_the_scene(tmp_path):
    """What it registers at import is known to the reader; Mitsuba is not imported."""
    path = tmp_path / "ours.py"
    path.write_text("raise ValueError('I was imported')")
    with pytest.raises(SceneError, match=r"ours.py:1: ValueError: I was imported"):
        read_scene(request_of(tmp_path, "diffuse", path))


def test_an_edit_of_the_file_is_another_picture(tmp_path, plugins):
    """Its bytes count, not where it is; without a file the name is another one."""
    scene = request_of(tmp_path, "plain_diffuse", plugins)
    first = entry_name(scene, [])
    elsewhere = tmp_path / "elsewhere" / plugins.name
    elsewhere.parent.mkdir()
    elsewhere.write_bytes(plugins.read_bytes())
    assert entry_name(request_of(tmp_path, "plain_diffuse", elsewhere), []) == first
    assert entry_name(request_of(tmp_path, "plain_diffuse"), []) != first
    plugins.write_text(PLUGINS + "# another one\n")
    assert entry_name(scene, []) != first


def test_the_file_may_import_a_neighbour_whose_edit_counts(tmp_path, plugins):
    """In both processes, when it is imported as well as when Mitsuba's side registers."""
    beside = plugins.with_name("beside.py")
    plugins.rename(beside)
    plugins.write_text(
        "import beside\ndef register_mitsuba():\n"
        "    from beside import register_mitsuba\n    register_mitsuba()\n"
    )
    scene = request_of(tmp_path, "plain_diffuse", plugins)
    with MitsubaWorker(120.0) as worker:
        references = ReferenceCache(worker.render, tmp_path / "references")
        assert np.ptp(references.get(scene, []).pixels) > 0.1
    folders = list(sys.path)
    import_plugin_file(str(plugins))
    assert sys.path == folders
    del sys.modules["beside"]
    first = entry_name(scene, [])
    beside.write_text(PLUGINS + "# another one\n")
    assert entry_name(scene, []) != first


@pytest.mark.parametrize("name", ["none.py", "plain_diffuse.txt"])
def test_a_file_that_is_no_python_file_is_a_wrong_command(tmp_path, capsys, name):
    (tmp_path / "plain_diffuse.txt").touch()
    assert main(["scene.xml", "--plugins", str(tmp_path / name)]) == 2
    assert "must be a Python file" in capsys.readouterr().err
