"""A film that is larger than memory: bands of it in turn, and the same file."""

from __future__ import annotations

import filecmp
from pathlib import Path

import Imath
import mitsuba as mi
import numpy as np
import OpenEXR
import pytest

import renderer
from renderer.command.cli import main
from renderer.errors import NotAllowed, SceneError
from renderer.process import memory
from renderer.rendering import memory_estimate, render_to_file
from renderer.rendering.aovs import plans_of
from renderer.rendering.film.band import Band, FilmShape
from renderer.rendering.film.film import Film
from renderer.rendering.job import film_shape
from renderer.rendering.memory_estimate import estimate_all, rows_at_once
from renderer.rendering.picture.exr_rows import ExrRows
from renderer.rendering.picture.image import Image
from renderer.rendering.progress_display import Progress
from renderer.rendering.render_options import RenderOptions

mi.set_variant("scalar_rgb")

SCENE = """<scene version="3.0.0">{integrator}
<emitter type="constant"><rgb name="radiance" value="0.2, 0.5, 0.9"/></emitter>
<shape type="sphere"><bsdf type="diffuse"/></shape>
<sensor type="perspective"><transform name="to_world"><translate z="-4"/></transform>
<film type="hdrfilm"><integer name="width" value="{width}"/>
<integer name="height" value="{height}"/><rfilter type="{rfilter}"/>{more}</film>
<sampler type="independent"/></sensor></scene>"""
CROP = """<integer name="crop_offset_x" value="5"/>
<integer name="crop_offset_y" value="41"/><integer name="crop_width" value="50"/>
<integer name="crop_height" value="99"/>"""
AOVS = """<integrator type="aov"><string name="aovs" value="p:position,d:depth"/>
<integrator type="path"/></integrator>"""
MOMENT = '<integrator type="moment"><integrator type="path"/></integrator>'
BORDER = '<boolean name="sample_border" value="true"/>'
FILMS = {
    "box": ("", 70, 150, "box", ""),
    "gaussian": ("", 70, 150, "gaussian", ""),
    "wide filter": ("", 40, 200, "lanczos", ""),
    "crop": ("", 70, 150, "gaussian", CROP),
    "beyond the film": ("", 70, 131, "gaussian", BORDER),
    "one column": ("", 20, 320, "tent", ""),
    "one row of tiles": ("", 300, 20, "gaussian", ""),
    "AOVs and colours": (AOVS, 70, 150, "gaussian", ""),
    "moments": (MOMENT, 70, 150, "box", ""),
}


def load(name: str) -> renderer.Scene:
    integrator, width, height, rfilter, more = FILMS[name]
    return renderer.load_string(
        SCENE.format(
            integrator=integrator, width=width, height=height, rfilter=rfilter, more=more
        )
    )


@pytest.fixture(params=[1, 2])
def narrow(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bands of so few rows of tiles next to those that are carried on."""

    def few(shape: FilmShape, room: int) -> int:
        return shape.carried + int(request.param)

    monkeypatch.setattr(render_to_file, "rows_at_once", few)


@pytest.mark.parametrize("name", FILMS)
def test_the_file_is_that_of_the_whole_film(
    tmp_path: Path, narrow: None, name: str
) -> None:
    """Byte for byte: pixels, channels and metadata; at several numbers of threads."""
    scene = load(name)
    renderer.render(scene, spp=3, seed=5).save(tmp_path / "whole.exr")
    seen: list[Progress] = []
    found = renderer.render_to_file(
        scene, tmp_path / "bands.exr", spp=3, seed=5, threads=3, progress=seen.append
    )
    film = scene.description.camera.film
    assert (found.width, found.height, found.spp) == (film.crop_width, film.crop_height, 3)
    assert filecmp.cmp(tmp_path / "whole.exr", tmp_path / "bands.exr", shallow=False)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bands.exr", "whole.exr"]
    rendered = [now for now in seen if now.stage == "render"]
    assert rendered[-1].done == rendered[-1].total == rendered[0].total
    assert [now.done for now in rendered] == sorted(now.done for now in rendered)


@pytest.mark.parametrize("border", [0, 3, 16, 17, 40])
@pytest.mark.parametrize("rows", [1, 2, 5])
def test_bands_give_each_row_once_and_no_sum_twice(border: int, rows: int) -> None:
    """Whatever the sums are: those of a whole film go through bands and come out alike."""
    shape = FilmShape(2, 3, 4, 37, 301, border, 60, 0, 32)
    rng = np.random.default_rng(1)
    film = Film(*shape)
    film.sums[:] = rng.random(film.sums.shape)
    by_rows = film.sums.reshape(
        shape.layers, shape.rows, shape.columns, *film.sums.shape[1:]
    )
    band, carried, parts = Band(shape, shape.carried + rows), 0, []
    first = 0
    while True:
        count = band.grid.rows
        own = band.sums.reshape(shape.layers, count, *by_rows.shape[2:])
        assert np.array_equal(own[:, :carried], by_rows[:, first : first + carried])
        assert not own[:, carried:].any()
        own[:] = by_rows[:, first : first + count]
        tiles = film.tiles[first * shape.columns :]
        assert np.array_equal(band.tiles, tiles[: count * shape.columns])
        parts.append(band.develop(2))
        following = band.following()
        if following is None:
            break
        first, carried = first + count - shape.carried, shape.carried
        band = following
    assert np.array_equal(np.vstack(parts), film.develop())


def test_openexr_and_mitsuba_read_the_file(tmp_path: Path, narrow: None) -> None:
    scene = load("gaussian")
    path = tmp_path / "bands.exr"
    renderer.render_to_file(scene, path, spp=2, metadata={"command": "a söng"})
    expected = np.asarray(renderer.render(scene, spp=2))
    with OpenEXR.File(str(path)) as file:
        header = dict(file.header())
        assert np.array_equal(file.channels()["RGB"].pixels, expected)
    assert header["command"] == "a söng"
    assert (header["spp"], header["integrator"]) == (2, "path")
    found = np.array(mi.Bitmap(str(path)))
    assert np.array_equal(found[..., :3], expected)


def test_a_small_limit_forces_bands_and_the_command_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of 12 MiB the kernels, the threads and one band must do; the film needs 20."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(memory, "resident", lambda: 0)
    monkeypatch.setattr(memory_estimate, "_loaded", True)
    integrator, _, _, rfilter, more = FILMS["gaussian"]
    text = SCENE.format(
        integrator=integrator, width=70, height=4000, rfilter=rfilter, more=more
    )
    (tmp_path / "tall.xml").write_text(text)
    how = ["tall.xml", "--spp", "1", "--threads", "2"]
    assert main([*how, "--quiet", "-o", "whole.exr"]) == 0
    capsys.readouterr()
    assert main([*how, "-o", "bands.exr", "--memory", "12MiB"]) == 0
    said = capsys.readouterr()
    assert "the film is larger than memory: it is written to bands.exr in bands" in said.err
    assert said.out.startswith("70 x 4000 pixels, 1 spp, ")
    assert filecmp.cmp("whole.exr", "bands.exr", shallow=False)
    for other in ("-o x.png", "-o x.exr -o y.exr", "-o x.exr --time 1 --spp 2"):
        assert main([*how, "--memory", "12MiB", *other.split()]) == 1
        found = capsys.readouterr().err
        assert "possible: a smaller film; `-o NAME.exr` alone" in found
        assert found.count("\n") == 1
    assert main([*how, "-o", "x.exr", "--memory", "2MiB"]) == 1
    assert "possible: a film of fewer columns" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "bands.exr",
        "tall.xml",
        "whole.exr",
    ]


def test_an_interrupt_leaves_no_file_and_what_was_there_stays(
    tmp_path: Path, narrow: None
) -> None:
    path = tmp_path / "bands.exr"
    path.write_bytes(b"before")

    def interrupt(now: Progress) -> None:
        if now.stage == "render" and now.done > now.total // 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        renderer.render_to_file(load("box"), path, spp=1, progress=interrupt)
    assert path.read_bytes() == b"before"
    assert [each.name for each in tmp_path.iterdir()] == ["bands.exr"]


def test_what_bands_cannot_do_is_refused(tmp_path: Path) -> None:
    scene = load("box")
    for how, message in (
        ({"integrator": "work"}, "integrator 'work' needs the whole film in memory"),
        ({"sampler": "mitsuba"}, "sampler 'mitsuba' needs the whole film in memory"),
        ({"accel": "none"}, "accelerator 'none' is unknown"),
    ):
        with pytest.raises(SceneError, match=message):
            renderer.render_to_file(scene, tmp_path / "x.exr", **how)
    with pytest.raises(SceneError, match=r"an \.exr file alone"):
        renderer.render_to_file(scene, tmp_path / "x.png")
    with pytest.raises(SceneError, match="there is no folder"):
        renderer.render_to_file(scene, tmp_path / "none/x.exr")
    with pytest.raises(NotAllowed, match="rendering takes about"):
        renderer.render_to_file(scene, tmp_path / "x.exr", memory="1MiB")
    assert not list(tmp_path.iterdir())


def test_bands_have_tiles_for_all_threads_and_fit() -> None:
    shape = FilmShape(3, 0, 0, 32768, 32768, 3, 32768, 0, 32)
    assert shape.carried == 1
    assert shape.layers == 1
    for room in (2**28, 2**30, 2**34):
        rows = rows_at_once(shape, room)
        assert 2 <= rows <= 5
        assert rows * shape.bytes_of_row <= max(room // 2, 2 * shape.bytes_of_row)
    assert rows_at_once(shape._replace(width=32), 2**34) > 1000


@pytest.mark.slow
def test_a_channel_may_have_more_than_two_gigabytes(tmp_path: Path) -> None:
    """Where products of 32 bits overflow: an older class of OpenEXR ended in a crash."""
    path = tmp_path / "large.exr"
    width, height, at_once = 32768, 16384 + 64, 64
    rows = np.zeros((at_once, width, 3), np.float32)
    with ExrRows(path, width, height) as file:
        for first in range(0, height, at_once):
            rows[0, 0] = first
            file.add(Image(rows, spp=1))
    part = OpenEXR.InputFile(str(path))
    single = Imath.PixelType(Imath.PixelType.FLOAT)
    for first in (0, 8192, 16384):
        row = np.frombuffer(part.channel("G", single, first, first), np.float32)
        assert row[0] == first
        assert not row[1:].any()
    part.close()


def test_a_band_becomes_smaller_until_all_that_is_needed_has_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Kernels and the picture take some of the room that the first band is chosen for."""
    scene = load("gaussian")
    todo, options = plans_of(scene, RenderOptions()), RenderOptions(threads=1)
    least = film_shape(*todo[0]).carried + 1
    needed = [estimate_all(todo, options, rows).total for rows in (least, 4 * least)]
    assert needed[0] < needed[1]
    monkeypatch.setattr(render_to_file.room_of_memory, "room", lambda: needed[0])
    monkeypatch.setattr(render_to_file, "rows_at_once", lambda shape, room: 4 * least)
    renderer.render_to_file(scene, tmp_path / "a.exr", spp=1, threads=1)
    assert (tmp_path / "a.exr").is_file()
