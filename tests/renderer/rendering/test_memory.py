"""Memory is estimated before it is taken, and what would take too much is refused."""

from __future__ import annotations

import gc
import struct
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from image_files import png_file
from PIL import Image as Pillow
from serialized_files import Mesh, ball, file_of, serialized, stream

import renderer
from renderer import scene_file
from renderer.accelerators.build import build_accelerators
from renderer.command.cli import main
from renderer.errors import NotAllowed, SceneError
from renderer.process import memory
from renderer.process.memory import parse_size, shown
from renderer.rendering import memory_estimate
from renderer.rendering.aovs import nested_scene
from renderer.rendering.memory_estimate import estimate
from renderer.rendering.planning.make_plan import make_plan, plan_with
from renderer.rendering.render_options import RenderOptions

MIB = 1 << 20
SENSOR = '<sensor type="perspective"/>'
TEXTURE = (
    '<shape type="sphere"><bsdf type="diffuse"><texture name="reflectance" type="bitmap">'
    '<string name="filename" value="{}"/></texture></bsdf></shape>'
)
USES = {
    "ply": '<shape type="ply"><string name="filename" value="{}"/></shape>',
    "obj": '<shape type="obj"><string name="filename" value="{}"/></shape>',
    "serialized": '<shape type="serialized"><string name="filename" value="{}"/></shape>',
    "vol": '<shape type="sdfgrid"><string name="filename" value="{}"/></shape>',
    "binary": '<shape type="sphere"><bsdf type="merl"><string name="filename" value="{}"/>'
    "</bsdf></shape>",
    "spd": '<shape type="sphere"><bsdf type="diffuse"><spectrum name="reflectance" '
    'filename="{}"/></bsdf></shape>',
}


def read(path: Path) -> scene_file.SceneDescription:
    use = USES.get(path.suffix[1:], TEXTURE).format(path.name)
    xml = f'<scene version="3.0.0">{use}{SENSOR}</scene>'
    return scene_file.read_string(xml, base_dir=path.parent)


# ------------------------------------------------------ headers that promise too much


def png(width: int, height: int, bits: int, data: bytes = b"") -> bytes:
    return png_file((width, height), (2, bits), data)


def exr(path: Path, compression: str, side: int) -> bytes:
    """Return a file of 64 x 64 pixels whose header says that there are more."""
    header = {
        "compression": getattr(OpenEXR, f"{compression}_COMPRESSION"),
        "type": OpenEXR.scanlineimage,
    }
    planes = {name: np.zeros((64, 64), np.float32) for name in "RGB"}
    OpenEXR.File(header, planes).write(str(path))
    there, said = (struct.pack("<4i", 0, 0, n - 1, n - 1) for n in (64, side))
    return path.read_bytes().replace(there, said) + bytes(8 * side)  # the table of chunks


def jpeg(path: Path, side: int) -> bytes:
    Pillow.new("RGB", (64, 64)).save(path)
    content = path.read_bytes()
    at = content.index(b"\xff\xc0") + 5
    return content[:at] + struct.pack(">HH", side, side) + content[at + 4 :]


PLY = (
    "ply\nformat {} 1.0\nelement vertex 1000000000\nproperty float x\nproperty float y\n"
    "property float z\nelement face 1000000000\nproperty list uchar int vertex_indices\n"
    "end_header\n"
)
FEW = Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]]))
LIES = {
    "ascii.ply": lambda path: PLY.format("ascii").encode() + b"0 0 0\n" * 100,
    "binary.ply": lambda path: PLY.format("binary_little_endian").encode() + bytes(500),
    "faces.obj": lambda path: b"v 0 0 0\n" * 3 + b"f 1 2 1000000000\n",
    "counts.serialized": lambda path: file_of([stream(FEW, 4, (10**9, 10**9))], 4),
    "eight.png": lambda path: png(13000, 13000, 8),
    "sixteen.png": lambda path: png(16000, 16000, 16),
    "picture.jpg": lambda path: jpeg(path, 13000),
    "zip.exr": lambda path: exr(path, "ZIP", 16000),
    "plain.exr": lambda path: exr(path, "NO", 16000),
    "sky.hdr": lambda path: b"#?RADIANCE\n\n-Y 16000 +X 16000\n" + bytes(500),
    "sky.pfm": lambda path: b"PF\n16000 16000\n-1\n" + bytes(500),
    "grid.vol": lambda path: (
        struct.pack("<3sB5i6f", b"VOL", 3, 1, *(1000,) * 3, 1, *(0,) * 6) + bytes(500)
    ),
    "table.binary": lambda path: struct.pack("<3i", 1000, 1000, 10) + bytes(500),
}


@pytest.mark.parametrize("name", LIES)
def test_a_header_that_promises_more_than_the_file_holds_costs_nothing(
    tmp_path: Path, name: str
) -> None:
    """Measured as the largest part of the process in memory, libraries in C included."""
    path = tmp_path / name
    path.write_bytes(LIES[name](path))
    refuse(path)  # loads what reads it
    peak_of_process = Path("/proc/self/clear_refs")
    if peak_of_process.exists():
        peak_of_process.write_text("5")  # resets the largest size that it ever had
    before = memory.resident()
    tracemalloc.start()
    found = refuse(path)
    _, traced = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert name in found
    assert traced < 4 * MIB
    if peak_of_process.exists():
        lines = Path("/proc/self/status").read_text().splitlines()
        (most,) = (int(line.split()[1]) for line in lines if line.startswith("VmHWM"))
        assert 1024 * most - before < 16 * MIB


def refuse(path: Path) -> str:
    with pytest.raises(SceneError) as caught:
        read(path)
    return str(caught.value)


# ---------------------------------------------------------- files that are what they say


def write_files(folder: Path) -> None:
    """Write an honest file of each kind, of some 100 KB or more."""
    rng = np.random.default_rng(3)
    x, y = (axis.ravel() for axis in np.mgrid[:60, :60] / 60.0)
    points = np.column_stack([x, y, 0.1 * np.sin(9 * x) * y])
    corner = (60 * np.arange(59)[:, None] + np.arange(59)).ravel()[:, None]
    faces = np.vstack([corner + np.array(one) for one in ((0, 60, 61), (0, 61, 1))])
    rows = "\n".join(f"{a:.6g} {b:.6g} {c:.6g}" for a, b, c in points)
    listed = "\n".join(f"3 {a} {b} {c}" for a, b, c in faces)
    header = PLY.replace("1000000000", "{}").format("{}", len(points), len(faces))
    text = f"{header.format('ascii')}{rows}\n{listed}\n"
    (folder / "ascii.ply").write_text(text)
    records = np.zeros(len(faces), [("n", "u1"), ("v", "<i4", 3)])
    records["n"], records["v"] = 3, faces
    binary = header.format("binary_little_endian").encode()
    (folder / "binary.ply").write_bytes(
        binary + points.astype("<f4").tobytes() + records.tobytes()
    )
    lines = [f"v {row}" for row in rows.split("\n")]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    (folder / "mesh.obj").write_text("\n".join(lines))
    (folder / "mesh.serialized").write_bytes(serialized([ball(60, 60)], 4))
    size = (180, 200)
    colors = rng.integers(0, 255, (*size, 3), dtype=np.uint8)
    for name in ("rgb.png", "rgb.jpg", "rgb.bmp"):
        Pillow.fromarray(colors).save(folder / name)
    sixteen = rng.integers(0, 255, (size[0], 1 + 6 * size[1]), dtype=np.uint8)
    sixteen[:, 0] = 0  # no filter
    (folder / "sixteen.png").write_bytes(png(size[1], size[0], 16, sixteen.tobytes()))
    for name, kind in (("single.exr", np.float32), ("half.exr", np.float16)):
        planes = {c: rng.random(size).astype(kind) for c in "RGB"}
        OpenEXR.File({"type": OpenEXR.scanlineimage}, planes).write(str(folder / name))
    plain = rng.integers(1, 255, (*size, 4), dtype=np.uint8)
    plain[0, 0] = 128  # not the start of a packed row
    start = f"#?RADIANCE\n\n-Y {size[0]} +X {size[1]}\n".encode()
    (folder / "sky.hdr").write_bytes(start + plain.tobytes())
    for name, grid in (
        ("noise.vol", rng.random((24, 24, 24)) - 0.5),
        ("ball.vol", np.linalg.norm(np.mgrid[-1:1:40j, -1:1:40j, -1:1:40j], axis=0) - 0.6),
    ):
        said = struct.pack("<3sB5i6f", b"VOL", 3, 1, *grid.shape, 1, *(0,) * 6)
        (folder / name).write_bytes(said + grid.astype("<f4").tobytes())
    cells = (30, 30, 60)
    (folder / "table.binary").write_bytes(
        struct.pack("<3i", *cells) + rng.random(3 * 54000).astype("<f8").tobytes()
    )
    (folder / "paint.spd").write_text(
        "\n".join(f"{300 + k / 9:.2f} 0.5" for k in range(4000))
    )


FILES = (
    *("ascii.ply", "binary.ply", "mesh.obj", "mesh.serialized"),
    *("rgb.png", "rgb.jpg", "rgb.bmp", "sixteen.png", "single.exr", "half.exr", "sky.hdr"),
    *("noise.vol", "ball.vol", "table.binary", "paint.spd"),
)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("files")
    write_files(folder)
    return folder


@pytest.fixture
def claims(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[int]]:
    """Return what is said to be taken, as it is said."""
    said: list[int] = []
    monkeypatch.setattr(memory, "require", lambda size, what: said.append(size))
    return said


@pytest.mark.parametrize("name", FILES)
def test_what_reading_a_file_takes_is_known_before(
    files: Path, claims: list[int], name: str
) -> None:
    """The largest claim is between the true peak less a fifth and three times as much.

    Three times, because what Pillow has in memory of its own is not traced.
    """
    read(files / name)  # imports what reads it
    gc.collect()
    claims.clear()
    tracemalloc.start()
    read(files / name)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert 0.8 * peak <= max(claims) <= 3.0 * peak + 100_000


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_does_not_fit_is_refused_with_both_numbers(
    files: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setattr(memory, "SMALL", 0)
    monkeypatch.setattr(memory, "resident", lambda: 0)
    with memory.limited_to(200_000), pytest.raises(NotAllowed) as caught:
        read(files / name)
    found = str(caught.value)
    assert name in found
    assert " of memory; of the 195 KiB allowed 195 KiB are left (--memory SIZE" in found


def test_a_small_file_that_unpacks_to_much_is_refused_before(tmp_path: Path) -> None:
    """An honest PNG of 40 KB with 8000 x 800 pixels of 16 bits."""
    content = png(8000, 800, 16, bytes(800 * (1 + 6 * 8000)))
    path = tmp_path / "black.png"
    path.write_bytes(content)
    assert len(content) < 60_000
    tracemalloc.start()
    with memory.limited_to(memory.resident() + 100 * MIB), pytest.raises(NotAllowed):
        read(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 4 * MIB


def test_an_xml_file_of_many_elements_ends_where_memory_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also if they come from many small files that include each other, ten times each."""
    monkeypatch.setattr(memory, "resident", lambda: 0)
    monkeypatch.setattr(memory, "SMALL", 0)
    xml = f'<scene version="3.0.0">{"<path/>" * 20000}</scene>'
    with memory.limited_to(10 * MIB), pytest.raises(NotAllowed, match="more elements"):
        scene_file.read_string(xml, base_dir=tmp_path)
    taken = iter(range(10**9))
    monkeypatch.setattr(memory, "resident", lambda: 10_000 * next(taken))
    for k in range(14):
        name = f"part{k + 1}.xml"
        include = f'<include filename="{name}"/>' * 10
        (tmp_path / f"part{k}.xml").write_text(f'<scene version="3.0.0">{include}</scene>')
    (tmp_path / "part14.xml").write_text('<scene version="3.0.0"/>')
    with memory.limited_to(10 * MIB), pytest.raises(NotAllowed, match="part"):
        scene_file.read_file(tmp_path / "part0.xml")


# --------------------------------------------------------------------------- renders

MESH = '<shape type="ply"><string name="filename" value="binary.ply"/></shape>'
# twelve triangles above, thousands below
GROUP = f"""<shape type="cube"/><shape type="shapegroup" id="group">{MESH}</shape>
<shape type="instance"><ref id="group"/></shape>"""
BOX = f"""<scene version="3.0.0">{{integrator}}<emitter type="constant"/>{MESH}
<sensor type="perspective"><film type="hdrfilm"><integer name="width" value="{{side}}"/>
<integer name="height" value="{{side}}"/></film></sensor></scene>"""
AOVS = """<integrator type="aov"><string name="aovs" value="a:position,b:depth,c:uv"/>
<integrator type="path"/></integrator>"""
RENDERS = {
    "mesh": ("", 32, {}),
    "mesh in a kd-tree": ("", 32, {"accel": "kd-sah"}),
    "film": ("", 256, {}),
    "film with AOVs": (AOVS, 128, {}),
    "a goal": ("", 128, {"target_error": 0.9}),
    "a replay": ("", 128, {"sampler": "mitsuba"}),
}


@pytest.mark.parametrize("name", RENDERS)
def test_what_a_render_takes_is_known_before(files: Path, name: str) -> None:
    """No less than is really allocated, and at most 2.5 times as much."""
    integrator, side, how = RENDERS[name]
    xml = BOX.format(integrator=integrator, side=side)
    scene = renderer.load_string(xml, base_dir=files)
    renderer.render(scene, spp=2, threads=2, **how)  # what is compiled is no part of it
    scene = renderer.load_string(xml, base_dir=files)  # without accelerators
    options = RenderOptions(spp=2, threads=2, **how)
    found = estimate(scene, plan_with(scene, options), options)
    assert found.parts["the kernels"] == 0  # they are there since the first render
    gc.collect()
    tracemalloc.start()
    renderer.render(scene, spp=2, threads=2, **how)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak <= found.total <= 2.5 * peak


def test_what_the_tree_of_a_group_takes_is_known_before(files: Path) -> None:
    """A mesh below, a cube above: what is chosen for that says nothing of the mesh."""
    xml = BOX.format(integrator="", side=32).replace(MESH, GROUP)
    scene = renderer.load_string(xml, base_dir=files)
    build_accelerators(scene, "auto")  # what is compiled is no part of it
    scene = renderer.load_string(xml, base_dir=files)
    plan = make_plan(scene, spp=2)
    found = estimate(scene, plan, RenderOptions(threads=2)).parts["accelerators"]
    gc.collect()
    tracemalloc.start()
    build_accelerators(scene, "auto", plan.rays)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak <= found <= 1.5 * peak


def test_a_render_that_does_not_fit_is_refused_with_what_needs_how_much(
    files: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(memory, "resident", lambda: 0)
    monkeypatch.setattr(memory_estimate, "_loaded", True)  # whichever test was first
    scene = renderer.load_string(BOX.format(integrator="", side=20000), base_dir=files)
    with pytest.raises(NotAllowed) as caught:
        renderer.render(scene, memory="4GiB")
    found = str(caught.value)
    assert found.startswith("<string>: rendering takes about 25.8 GiB")
    assert "(the film's sums 16.9 GiB, the picture 8.94" in found
    assert "of the 4 GiB allowed 4 GiB are left; possible: a smaller film; " in found
    with pytest.raises(SceneError, match="sizes such as 4GiB"):
        renderer.render(scene, memory="much")
    with pytest.raises(SceneError, match="sizes from 1 byte"):
        renderer.render(scene, memory=0)


def test_aovs_and_colours_are_refused_together_before_the_first_sample(
    files: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where each of them alone would fit."""
    monkeypatch.setattr(memory, "resident", lambda: 0)
    xml = BOX.format(integrator=AOVS, side=512)
    scene = renderer.load_string(xml, base_dir=files)
    plan = make_plan(scene, spp=2, threads=2)
    inside = nested_scene(scene, plan)
    assert inside is not None
    options = RenderOptions(threads=2)
    aovs = estimate(scene, plan, options)
    colours = estimate(inside, make_plan(inside, spp=2), options)
    both = aovs.together(colours)
    assert both.total == aovs.total + colours.total - colours.parts["the kernels"]
    room = both.total - 1
    assert max(aovs.total, colours.total) < room
    with pytest.raises(
        NotAllowed, match=r"\(not with --frames, --cluster, --checkpoint or"
    ):
        renderer.render(scene, spp=2, threads=2, memory=room)


def test_a_limit_inside_of_another_can_only_be_smaller(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(memory, "resident", lambda: 0)
    with memory.limited_to(5 * MIB):
        for inner, least in ((9 * MIB, 5), (2 * MIB, 2), (None, 5)):
            with memory.limited_to(inner):
                assert memory.room() == least * MIB


def test_without_a_limit_the_machine_and_its_control_groups_say_what_is_free(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert 0 < memory.room() < 2**62
    (tmp_path / "memory.max").write_text("1000000\n")
    (tmp_path / "memory.current").write_text("700000\n")
    (tmp_path / "memory.stat").write_text("anon 5\ninactive_file 200000\n")
    (*inner, outer) = memory._files_of_groups("9:cpu:/\n0::/a/b\n", tmp_path)
    assert [files[0].parent for files in inner] == [tmp_path / "a" / "b", tmp_path / "a"]
    assert memory._free_of(*outer) == [500000]
    assert memory._free_of(*inner[0]) == []  # it says nothing
    (tmp_path / "memory.max").write_text("max\n")
    assert memory._free_of(*outer) == []
    monkeypatch.setattr(memory, "_free_of_groups", lambda: [5, 3])
    assert memory.room() == 3
    assert memory.whose_room() == "this machine has 3 bytes free"


@pytest.mark.parametrize(
    ("text", "size"),
    [
        ("4GiB", 4 << 30),
        ("500 MB", 500 * 10**6),
        ("2G", 2 * 10**9),
        ("1.5kib", 1536),
        (7, 7),
    ],
)
def test_sizes(text: str | int, size: int) -> None:
    assert parse_size(text) == size


@pytest.mark.parametrize("text", ["", "GiB", "4 Gb/s", "-1", "1e3", "4PiB", 0, -5, True])
def test_no_sizes(text: object) -> None:
    with pytest.raises(SceneError, match="memory is"):
        parse_size(text)  # type: ignore[arg-type]


def test_sizes_for_people() -> None:
    assert [shown(size) for size in (5, 2048, 3 * MIB + 1, 5.25 * 2**30, 10**17)] == [
        "5 bytes",
        "2 KiB",
        "3 MiB",
        "5.25 GiB",
        "90,949 TiB",
    ]


def test_the_command_explains_and_refuses(
    files: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(memory, "resident", lambda: 0)
    monkeypatch.setattr(memory_estimate, "_loaded", False)
    path = files / "scene.xml"
    path.write_text(BOX.format(integrator="", side=8))
    assert main([str(path), "--explain", "--memory", "1GiB"]) == 0
    output = " ".join(capsys.readouterr().out.split())
    assert "Memory in addition to the scene at most 16" in output
    assert "(the kernels 150 MiB, " in output
    assert "of the 1 GiB allowed 1 GiB are left" in output
    given = [str(path), "-o", str(files / "x.png"), "--memory", "100MiB"]
    assert main(given) == 1
    found = capsys.readouterr().err
    assert found.count("\n") == 1
    assert "rendering takes about 16" in found
    assert not (files / "x.png").exists()
    assert main([str(path), "--memory", "little"]) == 2
