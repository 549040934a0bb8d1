"""OBJ files read a block at a time hold what they hold read line by line."""

from __future__ import annotations

import numpy as np
import pytest

from renderer.errors import SceneError
from renderer.process import memory
from renderer.scene_file.meshes import obj_blocks, obj_file
from renderer.scene_file.meshes.obj_blocks import read_blocks

CORNERS = {
    "v": "{0}",
    "v/vt": "{0}/{1}",
    "v//vn": "{0}//{2}",
    "v/vt/vn": "{0}/{1}/{2}",
}


def ordinary(form: str, seed: int, *, same: bool = False) -> bytes:
    """Return a file of random polygons; `same`: a corner has one index for all."""
    rng = np.random.default_rng(seed)
    counts = rng.integers(3, 40, 3)
    end = ["\n", "\r\n", " \n", "\t\n"][seed % 4]
    lines = ["# made at random", "", "mtllib a.mtl", "o thing"]
    lines += [f"v {x:.6g}\t{y:.9g}  {z:e}" for x, y, z in rng.normal(size=(counts[0], 3))]
    lines += ["", "g part_1", "usemtl stone"]
    lines += [f"vt {u} {v} 0" for u, v in rng.random((counts[1], 2))]
    lines += [f"vn {x} {y} {z}" for x, y, z in rng.normal(size=(counts[2], 3))]
    for number in range(rng.integers(1, 60)):
        if number % 7 == 3:
            lines += ["s off", "v 1 2 3"]  # another run of vertices
        corners = rng.integers(1, counts + 1, (rng.integers(3, 6), 3))
        if same:
            corners = np.repeat(rng.integers(1, counts.min() + 1, (3, 1)), 3, axis=1)
        lines.append("f " + " ".join(CORNERS[form].format(*corner) for corner in corners))
    return (end.join(lines) + (end if seed % 2 else "")).encode()


def both(tmp_path, monkeypatch, content: bytes, **options):
    """Return the mesh, or the error, read in each way."""
    path = tmp_path / "mesh.obj"
    path.write_bytes(content)
    found = []
    for _ in range(2):
        try:
            found.append(obj_file.read_obj(path, **options))
        except SceneError as error:
            found.append(error)
        monkeypatch.setattr(obj_file, "read_blocks", lambda content, **options: None)
    return found


def assert_same(one, other):
    if isinstance(other, SceneError):
        assert str(one) == str(other)
        return
    for name in ("vertices", "faces", "normals", "uvs"):
        a, b = getattr(one, name), getattr(other, name)
        assert (a is None) == (b is None), name
        if a is not None:
            assert a.dtype == b.dtype
            np.testing.assert_array_equal(a, b, err_msg=name)
    assert one.warnings == other.warnings


@pytest.mark.parametrize("face_normals", [False, True])
@pytest.mark.parametrize("form", CORNERS)
def test_ordinary_files_are_read_in_blocks_to_the_same_bits(
    form, face_normals, tmp_path, monkeypatch
):
    for seed in range(12):
        content = ordinary(form, seed, same=seed % 3 == 0)
        assert read_blocks(content, face_normals=face_normals) is not None, seed
        one, other = both(tmp_path, monkeypatch, content, face_normals=face_normals)
        assert not isinstance(other, SceneError)
        assert_same(one, other)
        monkeypatch.undo()


HEAD = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0 0\nvt 1 1\nvn 0 0 1\n"
UNUSUAL = {
    "relative": HEAD + "f -1 -2 -3\n",
    "too far back": HEAD + "f -1 -2 -5\n",
    "continued": HEAD + "f 1 2 \\\n3\n",
    "continued comment": HEAD + "# a comment \\\nv 9 9 9\nf 1 2 3\n",
    "comment behind": HEAD + "f 1 2 3 # three\n",
    "comment behind a vertex": "v 0 0 0 # one\n" + HEAD + "f 1 2 3\n",
    "mixed corners": HEAD + "f 1/1 2 3\nf 1//1 2/2 3\n",
    "mixed as many slashes": HEAD + "f 1//1 2/2/1 3/1/\n",
    "slash at the end": HEAD + "f 1/ 2/ 3/\n",
    "slash in front": HEAD + "f /1 /2 /1\n",
    "four parts": HEAD + "f 1/1/1/1 2/1/1/1 3/1/1/1\n",
    "slash alone": HEAD + "f 1/1 2/1 3 / 1\n",
    "not a number": HEAD + "v 1 two 3\nf 1 2 3\n",
    "underscore": HEAD + "v 1_0 2 3\nf 1 2 3\n",
    "underscore in a corner": HEAD + "f 1_0 2 3\n",
    "nan": HEAD + "v nan inf 3\nf 1 2 3\n",
    "used nan": HEAD + "v nan inf 3\nf 1 2 5\n",
    "huge": HEAD + "v 1e999 2 3\nf 1 2 3\n",
    "short vertex": HEAD + "v 1 2\nf 1 2 3\n",
    "short and long": "v 1 2\nv 1 2 3 4\n" + HEAD + "f 3 4 5\n",
    "fourth number": "v 0 0 0 1\n" + HEAD + "f 1 2 3\n",
    "two corners": HEAD + "f 1 2\n",
    "zero": HEAD + "f 0 1 2\n",
    "beyond": HEAD + "f 1 2 9\n",
    "beyond the normals": HEAD + "f 1//1 2//1 3//2\n",
    "fraction": HEAD + "f 1.0 2 3\n",
    "too large": HEAD + "f 1 2 99999999999999999999\n",
    "no face": HEAD,
    "indented": HEAD + "  v 5 5 5\n f 1 2 3\n",
    "one vertex indented": HEAD + "  v 5 5 5\nf 1 2 3\n",
    "one face indented": HEAD + "\tf 1 2 4\nf 1 2 3\n",
    "one vertex behind a separator": HEAD + "\x1cv 5 5 5\nf 1 2 3\n",
    "one vertex without numbers": HEAD + "v# nothing\nf 1 2 3\n",
    "other lines": HEAD + "curv 1 2\nf 1 2 3\nvp 1\n",
    "latin-1": HEAD + "g caf\u00e9\nf 1 2 3\n",
    "no-break space": HEAD + "f 1\u00a02 3 4\n",
    "empty line kinds": "v\nvt\nvn\nf\n" + HEAD + "f 1 2 3\n",
    "normals that are no numbers": HEAD + "vn a b c\nf 1//1 2//1 3//1\n",
    "normals that do not exist": HEAD + "f 1//9 2//9 3//9\n",
}


@pytest.mark.parametrize("face_normals", [False, True])
@pytest.mark.parametrize("name", UNUSUAL)
def test_unusual_files_are_read_or_refused_alike(name, face_normals, tmp_path, monkeypatch):
    content = UNUSUAL[name].encode("latin-1")
    one, other = both(tmp_path, monkeypatch, content, face_normals=face_normals)
    assert_same(one, other)


def test_damaged_files_are_read_or_refused_alike(tmp_path, monkeypatch):
    """Files with bytes changed, left out or moved."""
    rng = np.random.default_rng(7)
    for seed in range(150):
        content = bytearray(ordinary(list(CORNERS)[seed % 4], seed % 10))
        for _ in range(rng.integers(1, 4)):
            place = int(rng.integers(len(content)))
            if rng.random() < 0.5:
                content[place] = rng.choice(list(b" \n\t/-#\\0159.evftn_\xa0\x1c\x00"))
            else:
                del content[place : place + int(rng.integers(1, 9))]
        one, other = both(tmp_path, monkeypatch, bytes(content))
        monkeypatch.undo()
        assert_same(one, other)


def numbers_of(words: list[str]) -> np.ndarray:
    """Return what a file of vertices holds, a multiple of three words."""
    lines = ["v " + " ".join(words[k : k + 3]) for k in range(0, len(words), 3)]
    blocks = read_blocks("\n".join([*lines, "f 1 1 1"]).encode(), face_normals=False)
    return blocks.v.ravel()


def test_numbers_are_rounded_as_python_rounds_them():
    """Also those of 18 digits, halfway between two doubles, or out of their range."""
    rng = np.random.default_rng(4)
    values = rng.normal(size=600).tolist()
    words = [form.format(x) for form in ("{!r}", "{:.9g}", "{:.17e}") for x in values]
    odd = [str(2 * int(x) + 1) for x in rng.integers(2**53, 2**54, 600)]
    words += [f"{m[:k]}.{m[k:]}" for k, m in zip(np.arange(600) % 16 + 1, odd, strict=True)]
    wide = zip(rng.integers(0, 10**18, 600), rng.integers(-320, 300, 600), strict=True)
    words += [f"{m}e{power}" for m, power in wide]
    words += ["+1", "-0", "0.", "-.5", ".5e3", "1E+5", "1e22", "1e23", "0e999", "1e-400"]
    words += ["9007199254740993", "9007199254740992.5", "000123.450", "0.1" + "0" * 40]
    words += ["9" * 30]
    found = numbers_of(words)
    expected = np.array([float(word) for word in words])
    np.testing.assert_array_equal(found.view(np.int64), expected.view(np.int64))


def test_blocks_end_anywhere(monkeypatch):
    """A line belongs to the block in which it begins."""
    content = ordinary("v/vt/vn", 2)
    whole = read_blocks(content, face_normals=False)
    for size in (1, 7, 64, 1000):
        monkeypatch.setattr(obj_blocks, "_BLOCK", size)
        parts = read_blocks(content, face_normals=False)
        for one, other in zip(whole, parts, strict=True):
            for a, b in zip(one, other, strict=True):
                np.testing.assert_array_equal(a, b)


def test_one_position_with_many_uv_takes_no_quadratic_time(tmp_path):
    """The vertices are those of `np.unique`, in the order in which they come first."""
    count = 3000
    uvs = "".join(f"vt {k} {k % 7}\n" for k in range(count))
    faces = "".join(f"f 1/{1 + k % 999} 2/1 3/1\n" for k in range(count))
    path = tmp_path / "fan.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n" + uvs + faces)
    mesh = obj_file.read_obj(path)
    assert len(mesh.vertices) == 999 + 2
    np.testing.assert_array_equal(mesh.faces[:3], [[0, 1, 2], [3, 1, 2], [4, 1, 2]])
    np.testing.assert_array_equal(mesh.faces[999], mesh.faces[0])


@pytest.mark.parametrize("line", ["\n", "# a remark\n", "\r\n", "o name\n"])
def test_the_memory_of_a_file_is_known_before_it_is_taken(line, monkeypatch, tmp_path):
    """Lines without a number take none; others do, and are refused with a sentence."""
    path = tmp_path / "lines.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n" + line * 2_000_000 + "f 1 2 3\n")
    required: list[int] = []
    monkeypatch.setattr(memory, "require", lambda size, what: required.append(size))
    obj_file.read_obj(path)
    assert (required[-1] > 100_000_000) == line.startswith("o")
