"""Every writer: the older file stays until the new one is whole and on the disk.

A disk that is full at any byte is a limit of this process on the size of files: the system
then refuses a write, or a part of it. A last buffer fails only when the file is flushed.
"""

from __future__ import annotations

import errno
import os
import resource
import stat
import threading
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from mitsuba_ref.records.json_files import write_atomically, write_json
from mitsuba_ref.reference.cache import write_entry
from mitsuba_ref.reference.render import Reference
from renderer.command.sweep import SweepRecord
from renderer.errors import SceneError
from renderer.plugins.bsdfs.merl_file import write_merl
from renderer.process.whole_file import is_stream, whole_file, why_not_writable, write_whole
from renderer.rendering.checkpoints.checkpoint import check_checkpoint_path
from renderer.rendering.checkpoints.file import write_checkpoint
from renderer.rendering.picture.exr_rows import ExrRows
from renderer.rendering.picture.image import Image

OLD = b"what was there before"
PIXELS = np.random.default_rng(3).random((32, 9, 3), dtype=np.float32)


def save(path):
    Image(PIXELS, metadata={"command": "lightproof scene.xml"}).save(path)


def save_in_rows(path):
    with ExrRows(path, 9, 32) as file:
        file.add(Image(PIXELS[:20]))
        file.add(Image(PIXELS[20:]))


def save_checkpoint(path):
    arrays = {"sums": PIXELS.astype(np.float64)}
    write_checkpoint(path, {"said": {}, "hashed": {}}, arrays, keep=False)


def save_sweep(path):
    record = SweepRecord(path.with_name("turn_####.exr"))
    assert record.path == path
    record.add([Path(f"turn_{n:04}.exr") for n in range(30)], "a digest")


def save_reference(path):
    write_entry(Reference({"pixels": PIXELS}, 0.5, 2, 4, "path", ()), path)


# name of the file -> what writes it
WRITERS = {
    "a.exr": save,
    "a.png": save,
    "a.npy": save,
    "rows.exr": save_in_rows,
    "a.ckpt": save_checkpoint,
    "turn_####.frames.json": save_sweep,
    "a.npz": save_reference,
    "a.binary": lambda path: write_merl(path, np.ones((3, 2, 3, 4))),
    "a.json": lambda path: write_json({"rows": [1.5] * 300}, path),
    "a.html": lambda path: write_atomically(path, bytes(2000)),
}


@contextmanager
def largest_file(size):
    """Let every write of this process fail beyond a size [bytes], as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.fixture(params=WRITERS)
def written(request, tmp_path):
    """Return a path with an older file, and what writes a new one."""
    path = tmp_path / request.param
    path.write_bytes(OLD)
    return path, WRITERS[request.param]


def test_a_disk_that_is_full_at_any_byte_costs_nothing(written):
    """One error, the older file, no remains; the last byte is the one that is forgotten."""
    path, write = written
    write(path)
    size = path.stat().st_size
    for limit in {*range(0, size, max(size // 13, 1)), size - 1}:
        path.write_bytes(OLD)
        with largest_file(limit), pytest.raises((OSError, SceneError), match="too large"):
            write(path)
        assert path.read_bytes() == OLD, limit
        assert os.listdir(path.parent) == [path.name], limit
    with largest_file(size):
        write(path)


@pytest.mark.parametrize("step", ["fsync", "replace"])
def test_an_error_of_the_last_steps_costs_nothing(written, step, monkeypatch):
    """A quota, or a disk behind a network, may refuse what was written long before."""
    path, write = written

    def refuse(*_):
        raise OSError(errno.EDQUOT, os.strerror(errno.EDQUOT))

    monkeypatch.setattr(os, step, refuse)
    with pytest.raises((OSError, SceneError), match="quota"):
        write(path)
    assert path.read_bytes() == OLD
    assert os.listdir(path.parent) == [path.name]


def test_a_link_stays_a_link(written, tmp_path):
    """Its target is written, also one that is not there yet, in its own folder."""
    path, write = written
    (tmp_path / "elsewhere").mkdir()
    target = tmp_path / "elsewhere" / "target"
    path.unlink()
    path.symlink_to(target.relative_to(tmp_path))
    for _ in range(2):
        write(path)
        assert path.is_symlink()
        assert target.stat().st_size > len(OLD)
        assert os.listdir(target.parent) == ["target"]


def test_a_read_only_file_is_refused(written):
    """For the superuser too, whom the system would let write."""
    path, write = written
    path.chmod(0o444)
    with pytest.raises((OSError, SceneError), match="is read-only"):
        write(path)
    assert path.read_bytes() == OLD


def test_permissions_are_those_of_the_file_before(written):
    path, write = written
    path.chmod(0o640)
    write(path)
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    path.unlink()
    umask = os.umask(0o027)
    try:
        write(path)
    finally:
        os.umask(umask)
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


@pytest.mark.parametrize("name", ["a.exr", "a.png", "a.npy", "rows.exr"])
def test_a_pipe_gets_the_bytes_of_a_file(name, tmp_path):
    """Whole, in order, although an EXR is written with steps back to its table."""
    write = WRITERS[name]
    expected, pipe = tmp_path / name, tmp_path / f"pipe{Path(name).suffix}"
    write(expected)
    os.mkfifo(pipe)
    read = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()))
    reader.start()
    write(pipe)
    reader.join()
    assert read == [expected.read_bytes()]
    assert stat.S_ISFIFO(pipe.stat().st_mode)


@pytest.mark.parametrize("device", ["/dev/null", "link"])
def test_a_device_is_written_and_stays(device, tmp_path):
    """Without an ending it gets an EXR: `-o /dev/null` is a render without a picture."""
    link = tmp_path / "link.png"
    link.symlink_to("/dev/null")
    path = link if device == "link" else Path(device)
    before = os.stat("/dev/null")
    save(path)
    assert os.stat("/dev/null").st_rdev == before.st_rdev
    assert link.is_symlink()


def test_a_full_device_is_an_error(tmp_path):
    with pytest.raises(SceneError, match=r"cannot be written: .*No space left"):
        save(Path("/dev/full"))
    (tmp_path / "a.exr").symlink_to("/dev/full")
    with pytest.raises(SceneError, match="No space left"):
        save_in_rows(tmp_path / "a.exr")


def test_what_no_file_can_be_is_refused_before_rendering(tmp_path):
    """A circle of links, a name that is too long, a file in the place of a folder."""
    (tmp_path / "circle.exr").symlink_to("circle.exr")
    (tmp_path / "file").write_bytes(b"")
    for path in ("circle.exr", f"{'n' * 300}.exr", "file/a.exr", "nowhere/a.exr", "."):
        assert why_not_writable(tmp_path / path), path
        with pytest.raises(OSError), whole_file(tmp_path / path):
            raise AssertionError("nothing must be written")
    assert sorted(os.listdir(tmp_path)) == ["circle.exr", "file"]
    assert not is_stream(tmp_path / "circle.exr")


def test_a_long_name_is_written(tmp_path):
    """255 bytes are possible, and a temporary name must not need more."""
    path = tmp_path / ("ä" * 125 + ".exr")
    save(path)
    assert os.listdir(tmp_path) == [path.name]


def test_an_error_in_the_block_keeps_the_file(tmp_path):
    path = tmp_path / "a"
    write_whole(path, OLD)
    for error in (KeyboardInterrupt, ValueError):
        with pytest.raises(error), whole_file(path) as file:
            file.write(b"half")
            raise error
    assert path.read_bytes() == OLD
    assert os.listdir(tmp_path) == ["a"]


def test_what_a_killed_process_left_goes_with_the_next_file(tmp_path):
    """Its part is as large as a film; that of a process or a thread that runs stays."""
    dead, other = threading.Thread(target=int), threading.Event()
    dead.start()
    dead.join()
    alive = threading.Thread(target=other.wait)
    alive.start()
    left = [f".a.png.{2**22 + 1}-7.part", f".a.png.{os.getpid()}-{dead.ident}.part"]
    kept = [f".a.png.{os.getppid()}-7.part", f".a.png.{os.getpid()}-{alive.ident}.part"]
    for name in (*left, *kept):
        (tmp_path / name).touch()
    save(tmp_path / "a.png")
    other.set()
    alive.join()
    assert sorted(os.listdir(tmp_path)) == sorted(["a.png", *kept])


def test_an_error_while_the_disk_is_full_is_the_one_that_is_raised(tmp_path):
    """What is left in the buffer fails once more when the file is closed."""
    with largest_file(10), pytest.raises(KeyboardInterrupt):
        with whole_file(tmp_path / "a") as file:
            file.write(bytes(100))
            raise KeyboardInterrupt
    with largest_file(3000), pytest.raises(SceneError, match=r"rows\.exr: .*too large"):
        with ExrRows(tmp_path / "rows.exr", 9, 320) as file:
            for _ in range(10):
                file.add(Image(PIXELS))
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("name", ["a\0.exr", "a\0"])
def test_a_zero_byte_in_a_name_is_one_line(name):
    with pytest.raises(SceneError):
        save(Path(name))


def test_a_checkpoint_needs_a_file(tmp_path):
    """From a device or a pipe nothing could be resumed."""
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/null")):
        with pytest.raises(SceneError, match="is a device or a pipe"):
            check_checkpoint_path(path, resume=True)
