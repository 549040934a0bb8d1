"""A scene reads what lies in its own folder, and nothing else unless the user allows it."""

from __future__ import annotations

import os
import socket
from pathlib import Path

import pytest

import renderer
from mitsuba_ref.command.verdict_of_error import NotCompared, with_the_other_side
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.reference.edited_scene import load_edited_scene
from renderer import scene_file
from renderer.command.cli import main
from renderer.errors import NotAllowed, SceneError
from renderer.scene_file.document.named_files import check_named_files

PLUGINS = Path(__file__).parents[2] / "plugins"
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
SHAPE = '<shape type="obj"><string name="filename" value="{}"/></shape>'
SENSOR = '<sensor type="perspective"/>'

# every way in which a scene can name a file, by what is in the file
WAYS = {
    "mesh.obj": SHAPE,
    "mesh.ply": '<shape type="ply"><string name="filename" value="{}"/></shape>',
    "mesh.serialized": '<shape type="serialized"><string name="filename" value="{}"/>'
    "</shape>",
    "grid.vol": '<shape type="sdfgrid"><string name="filename" value="{}"/></shape>',
    "curve.txt": '<shape type="linearcurve"><string name="filename" value="{}"/></shape>',
    "picture.png": '<bsdf type="diffuse"><texture name="reflectance" type="bitmap">'
    '<string name="filename" value="{}"/></texture></bsdf>',
    "sky.exr": '<emitter type="envmap"><string name="filename" value="{}"/></emitter>',
    "table.binary": '<bsdf type="merl"><string name="filename" value="{}"/></bsdf>',
    "a_rgb.bsdf": '<bsdf type="measured"><string name="filename" value="{}"/></bsdf>',
    "paint.spd": '<bsdf type="diffuse"><spectrum name="reflectance" filename="{}"/></bsdf>',
    "part.xml": '<include filename="{}"/>',
    "folder": '<path value="{}"/>',
}


@pytest.fixture
def folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, Path]:
    """Return a scene's folder and one next to it, with a mesh each."""
    monkeypatch.chdir(tmp_path)
    inside, outside = tmp_path / "scene", tmp_path / "elsewhere"
    for folder in (inside, outside):
        folder.mkdir()
        (folder / "mesh.obj").write_text(OBJ)
    return inside, outside


def write(folder: Path, content: str) -> Path:
    if content.startswith("<bsdf"):
        content = f'<shape type="sphere">{content}</shape>'
    path = folder / "scene.xml"
    path.write_text(f'<scene version="3.0.0">\n{content}\n{SENSOR}</scene>')
    return path


def refusal(path: Path, **options: object) -> str:
    with pytest.raises(NotAllowed) as caught:
        scene_file.read_file(path, **options)
    assert str(caught.value).startswith(f"{path}:2: ")
    return str(caught.value)


@pytest.mark.parametrize("name", WAYS)
def test_no_way_of_naming_a_file_leads_outside(folders, name: str) -> None:
    """Refused before it is opened: what is named here is no file of its kind at all."""
    inside, outside = folders
    target = outside / name
    target.mkdir() if name == "folder" else target.write_text("secret")
    for named in (str(target), f"../elsewhere/{name}", f"x/../../elsewhere/{name}"):
        (inside / "x").mkdir(exist_ok=True)
        found = refusal(write(inside, WAYS[name].format(named)))
        assert f"is {target}, outside of the scene's folder {inside}" in found
        assert "--allow-outside" in found
        assert "secret" not in found
        with pytest.raises(SceneError) as other:  # allowed, it is opened
            scene_file.read_file(inside / "scene.xml", allow_outside=outside)
            raise SceneError("the folder is allowed")
        assert not isinstance(other.value, NotAllowed)


def test_symbolic_links_count_by_where_they_lead(folders) -> None:
    inside, outside = folders
    (inside / "link.obj").symlink_to(outside / "mesh.obj")
    (inside / "links").symlink_to(outside)
    (inside / "deep").mkdir()
    (inside / "deep/back.obj").symlink_to("../mesh.obj")
    for named in ("link.obj", "links/mesh.obj"):
        assert str(outside / "mesh.obj") in refusal(write(inside, SHAPE.format(named)))
    scene = scene_file.read_file(write(inside, SHAPE.format("deep/back.obj")))
    assert len(scene.shapes) == 1
    (inside / "circle.obj").symlink_to("circle.obj")
    with pytest.raises(SceneError, match=r"circle\.obj"):
        scene_file.read_file(write(inside, SHAPE.format("circle.obj")))


@pytest.mark.parametrize("name", ["meshes\\Box.obj", "Meshes/BOX.OBJ"])
def test_a_path_of_windows_is_recognized(folders, name: str) -> None:
    """It is refused, as in Mitsuba, and the message has the path that is meant."""
    inside, outside = folders
    for folder in (inside, outside):
        (folder / "meshes").mkdir()
        (folder / "meshes/box.obj").write_text(OBJ)
    (inside / "link").symlink_to(outside / "meshes")
    hints = {name: '; did you mean "meshes/box.obj"?', f"../{name}": "", "LINK/box.obj": ""}
    for named, hint in hints.items():
        path = write(inside, SHAPE.format(named))
        with pytest.raises(SceneError) as caught:
            scene_file.read_file(path)
        assert str(caught.value).endswith(f"in: {inside}, {inside.parent}{hint}")


def test_the_folder_of_the_scene_may_be_a_link_and_the_scene_too(folders) -> None:
    inside, outside = folders
    path = write(inside, SHAPE.format("mesh.obj"))
    (outside / "again").symlink_to(inside)
    assert scene_file.read_file(outside / "again/scene.xml").shapes
    (outside / "scene.xml").symlink_to(path)  # its mesh is then the one next to the link
    assert scene_file.read_file(outside / "scene.xml").files[1:] == (
        str(outside / "mesh.obj"),
    )


def test_what_is_in_the_working_directory_is_outside_too(folders, monkeypatch) -> None:
    """It is searched, as by Mitsuba; a scene started in a home folder may not read it."""
    inside, outside = folders
    monkeypatch.chdir(outside)
    (outside / "only.obj").write_text(OBJ)
    path = write(inside, SHAPE.format("only.obj"))
    assert str(outside / "only.obj") in refusal(path)
    assert scene_file.read_file(path, allow_outside=".").shapes


@pytest.mark.parametrize("kind", ["pipe", "socket", "folder", "device", "process"])
def test_what_is_no_file_is_not_opened(folders, kind: str, monkeypatch) -> None:
    """A pipe would block for ever, and so the reader may not open one to find out."""
    inside, _ = folders
    monkeypatch.chdir(inside)
    path = {"device": Path("/dev/zero"), "process": Path("/proc/self/environ")}.get(
        kind, inside / "odd.obj"
    )
    with socket.socket(socket.AF_UNIX) as listening:
        if kind == "pipe":
            os.mkfifo(path)
        elif kind == "socket":
            listening.bind("odd.obj")
        elif kind == "folder":
            path.mkdir()
        found = refusal(write(inside, SHAPE.format(path)), allow_outside="/")
    words = {"pipe": "a named pipe", "process": "which no scene may read"}
    assert words.get(kind, f"is not a file but a {kind}") in found


def test_an_included_file_has_the_bounds_of_the_scene(folders) -> None:
    inside, _ = folders
    (inside / "parts").mkdir()
    part = inside / "parts/part.xml"
    path = write(inside, '<include filename="parts/part.xml"/>')
    part.write_text(f'<scene version="3.0.0">\n{SHAPE.format("mesh.obj")}</scene>')
    assert len(scene_file.read_file(path).shapes) == 1
    far = SHAPE.format("../elsewhere/mesh.obj")
    part.write_text(f'<scene version="3.0.0">\n{far}</scene>')
    with pytest.raises(NotAllowed, match=r"part\.xml:2: .* outside of the scene's folder"):
        scene_file.read_file(path)


def test_parameters_cannot_make_text_without_end(folders) -> None:
    """Each <default> twice the one before: 60 lines would be 10^18 letters."""
    inside, _ = folders
    lines = ['<default name="a0" value="0123456789"/>']
    lines += [f'<default name="a{k + 1}" value="$a{k};$a{k};"/>' for k in range(60)]
    path = write(inside, "\n".join(lines))
    with pytest.raises(SceneError, match="grows to more than"):
        scene_file.read_file(path)
    with pytest.raises(SceneError, match="grows to more than"):
        check_named_files(path, {})


def test_texts_have_the_bounds_of_their_folder_and_dictionaries_have_none(folders) -> None:
    inside, outside = folders
    mesh = {"type": "obj", "filename": str(outside / "mesh.obj")}
    content = {"type": "scene", "sensor": {"type": "perspective"}, "mesh": mesh}
    assert scene_file.read_dict(content, base_dir=inside).shapes
    assert renderer.load_dict(content).shape.size == 1
    for allowed in ((), inside, [inside]):
        with pytest.raises(NotAllowed, match="outside of the scene's folder"):
            renderer.load_dict(content, base_dir=inside, allow_outside=allowed)
    assert renderer.load_dict(content, base_dir=inside, allow_outside=[outside])
    text = f'<scene version="3.0.0">{SHAPE.format(outside / "mesh.obj")}{SENSOR}</scene>'
    with pytest.raises(NotAllowed, match="outside of the scene's folder"):
        renderer.load_string(text, base_dir=inside)
    assert renderer.load_string(text).shape.size == 1  # the working directory holds it
    with pytest.raises(SceneError, match="is not a folder"):
        renderer.load_string(text, allow_outside=outside / "mesh.obj")


def test_the_command_says_what_to_add_and_then_renders(folders, capsys) -> None:
    inside, outside = folders
    path = write(inside, SHAPE.format("../elsewhere/mesh.obj"))
    assert main([str(path), "--explain"]) == 1
    found = capsys.readouterr().err
    assert found.count("\n") == 1
    hint = found.rpartition("allow it: ")[2].split()
    assert hint == ["--allow-outside", str(outside)]
    assert main([str(path), "--explain", *hint]) == 0
    assert main([str(path), "--allow-outside", str(outside / "mesh.obj")]) == 2


class NobodyIsAsked:
    """The references of a comparison that must not reach Mitsuba."""

    def render_uncached(self, request: RenderRequest) -> None:
        raise AssertionError(f"Mitsuba was run for {request}")


@pytest.mark.parametrize("name", [name for name in WAYS if name != "folder"])
def test_what_we_refuse_to_open_mitsuba_does_not_see(folders, name: str) -> None:
    """Also where our reader stops on an earlier line, and plugins that ours has not."""
    inside, outside = folders
    (outside / "mesh.obj").unlink()
    os.mkfifo(outside / name)
    far = f"../elsewhere/{name}"
    unknown = '<bsdf type="velvet"/>'
    for content in (
        WAYS[name].format(outside / name),
        f'<shape type="hairs"><string name="filename" value="{far}"/></shape>',
        f'<default name="n" value="{far}"/><x><string name="y" value="$n"/></x>',
    ):
        path = write(inside, unknown + content)
        request = RenderRequest(str(path))
        ours = NotCompared("refused-by-us", ("our renderer: no velvet",))
        found = with_the_other_side(ours, request, NobodyIsAsked())  # type: ignore[arg-type]
        assert found.verdict == "refused-by-us"
        assert "Mitsuba was not run: " in found.other_side
        assert f"{path}:2: the file" in found.other_side


@pytest.mark.parametrize("place", ["beside", "path", "include", "type"])
def test_mitsuba_is_given_no_scene_that_brings_code(folders, place: str) -> None:
    """A library next to the scene would be run, even in the place of a built-in plugin."""
    inside, _ = folders
    path = write(
        inside,
        {
            "path": '<default name="n" value="more"/><path value="$n"/>',
            "include": '<include filename="more/part.xml"/>',
            "type": '<default name="n" value="../x"/><bsdf type="$n"/>',
        }.get(place, ""),
    )
    (inside / "more").mkdir()
    (inside / "more/part.xml").write_text('<scene version="3.0.0"/>')
    libraries = (inside if place == "beside" else inside / "more") / "plugins"
    if place != "type":
        libraries.mkdir()
        (libraries / "notes.txt").touch()
        check_named_files(path, {})
        (libraries / "diffuse.so").touch()
    said = "is a path" if place == "type" else r"diffuse\.so is a library"
    with pytest.raises(NotAllowed, match=said):
        check_named_files(path, {}, ["/"])
    with pytest.raises(RuntimeError, match=said):
        load_edited_scene(path, {})
    ours = NotCompared("refused-by-us", ("our renderer: no velvet",))
    request = RenderRequest(str(path))
    found = with_the_other_side(ours, request, NobodyIsAsked())  # type: ignore[arg-type]
    assert "Mitsuba was not run: " in found.other_side


def test_every_scene_here_stays_in_its_folder() -> None:
    """So that they can be tried without an option."""
    paths = [*Path("scenes").glob("*/scene.xml"), *PLUGINS.glob("*.xml")]
    assert len(paths) > 50
    for path in paths:
        check_named_files(path, {})
