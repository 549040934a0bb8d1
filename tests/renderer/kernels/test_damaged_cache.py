"""The cache of compiled kernels: damaged files, old files, and where it lies.

A cache must never be worse than no cache: whatever is in a file, a kernel is compiled again
and gives the right number.
"""

from __future__ import annotations

import errno
import json
import os
import pickle
import shutil
from pathlib import Path

import pytest
from numba.core import types
from processes import run_python

import renderer
from renderer.command.cli import main
from renderer.kernels.jit import cache
from renderer.kernels.jit.cache import _Index, use_folder
from renderer.process import cache_folder as folders
from renderer.process.cache_folder import cache_folder, cache_root, clear_caches

ROOT = Path(renderer.__file__).parents[1]
KERNEL = """
import logging, sys
logging.basicConfig(stream=sys.stdout, format="%(message)s")
from renderer.kernels.jit import entry_kernel

@entry_kernel
def triple(x):
    return 3 * x

assert triple(2) == 6 and triple(2.0) == 6.0
print(len(triple.stats.cache_hits), "hits")
"""


def run(folder):
    """Compile and call one kernel in a process of its own; return what it printed."""
    (folder / "program.py").write_text(KERNEL)
    environment = {"LIGHTPROOF_CACHE": str(folder / "cache"), "PYTHONPATH": str(ROOT)}
    done = run_python(
        "program.py", folder=folder, environment=os.environ | environment, check=True
    )
    return done.stdout


def flipped(content):
    """Return content with one bit changed in the middle: a pickle that still reads."""
    at = len(content) // 2
    return content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :]


DAMAGES = {
    "empty": lambda content: b"",
    "cut off": lambda content: content[:-7],
    "half": lambda content: content[: len(content) // 2],
    "zeros": lambda content: bytes(len(content)),
    "one bit": flipped,
    "text": lambda content: b"not a pickle",
    "another pickle": lambda content: pickle.dumps({"a": 1}),
}


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """A cache with one kernel in it, of two types: an index and two files of code."""
    folder = tmp_path_factory.mktemp("compiled")
    assert run(folder) == "0 hits\n"
    assert run(folder) == "2 hits\n"
    return folder, {path: path.read_bytes() for path in folder.rglob("*triple*.nb?")}


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("ending", [".nbi", ".nbc"])
def test_what_is_damaged_is_not_read_and_is_written_anew(tmp_path, caplog, ending, damage):
    """After that no kernel is found under the name of another."""
    cache._warned.clear()
    keys = [((types.int64,), "a"), ((types.float64,), "b")]
    for key in keys:
        _Index(str(tmp_path), "kernel", "").save(key, f"code of {key[1]}")
    for path in tmp_path.glob(f"*{ending}"):
        path.write_bytes(DAMAGES[damage](path.read_bytes()))
    assert [_Index(str(tmp_path), "kernel", "").load(key) for key in keys] == [None] * 2
    (said,) = caplog.messages
    assert said.startswith("kernels are compiled again") and said.endswith("is damaged")
    for key in reversed(keys):
        _Index(str(tmp_path), "kernel", "").save(key, f"new code of {key[1]}")
        if ending == ".nbi" and key is keys[1]:
            assert _Index(str(tmp_path), "kernel", "").load(keys[0]) is None
    found = [_Index(str(tmp_path), "kernel", "").load(key) for key in keys]
    assert found == ["new code of a", "new code of b"]


@pytest.mark.parametrize("ending", [".nbi", ".nbc"])
def test_a_damaged_file_is_compiled_again_with_one_warning(compiled, ending):
    """And is whole again for the run after that one."""
    folder, sound = compiled
    assert sorted(path.suffix for path in sound) == [".nbc", ".nbc", ".nbi"]
    for path, content in sound.items():
        if path.suffix == ending:
            path.write_bytes(flipped(content))
    said = run(folder)
    assert said.count("kernels are compiled again") == 1
    assert said.endswith("is damaged\n0 hits\n")
    assert run(folder) == "2 hits\n"


def test_a_folder_in_the_place_of_a_file_is_no_obstacle(compiled):
    folder, sound = compiled
    index = next(path for path in sound if path.suffix == ".nbi")
    index.unlink()
    index.mkdir()
    try:
        assert run(folder).endswith("0 hits\n")
    finally:
        index.rmdir()
        for path, content in sound.items():
            path.write_bytes(content)


def test_every_other_file_of_the_cache_may_be_damaged(compiled):
    folder, sound = compiled
    for path in (folder / "cache").rglob("*"):
        if path.is_file() and path not in sound:
            path.write_bytes(b"\xff\x00 damaged")
    assert run(folder) == "2 hits\n"


# --------------------------------------------------------------------- old kernels


def users(folder):
    return [tuple(user) for user in json.loads((folder / "used-by.json").read_text())]


def folders_of(tmp_path, *names):
    """Make folders with names that end in a hash, as those of kernels do."""
    made = [tmp_path / f"{name}{'0' * (16 - len(name))}" for name in names]
    for folder in made:
        folder.mkdir(exist_ok=True)
    return made


def test_a_folder_goes_with_its_last_user(tmp_path):
    """Two checkouts of equal sources share one; an edit in both of them removes it."""
    first, second = (str(tmp_path / name) for name in ("first", "second"))
    for package in (first, second):
        Path(package).mkdir()
    old, new, unknown = folders_of(tmp_path, "a", "b", "c")

    def use(folder, package):
        folder.mkdir(exist_ok=True)
        use_folder(folder, (package,), [old, new, unknown, tmp_path / "missing"])

    use(old, first)
    assert not unknown.exists()  # of a version that noted no users
    use(old, second)
    assert users(old) == [(first,), (second,)]
    use(new, first)
    assert (users(old), users(new)) == ([(second,)], [(first,)])
    use(new, second)
    assert not old.exists()
    assert users(new) == [(first,), (second,)]


def test_a_checkout_that_was_deleted_is_no_user(tmp_path):
    old, new = folders_of(tmp_path, "a", "b")
    (tmp_path / "package").mkdir()
    use_folder(old, (str(tmp_path / "deleted"),), [])
    use_folder(new, (str(tmp_path / "package"),), [old])
    assert not old.exists()


def test_what_may_be_another_ones_is_not_removed(tmp_path):
    """A folder of another kind of name, a link, and one whose note was cut off."""
    torn, new, target = folders_of(tmp_path, "a", "b", "c")
    (tmp_path / "package").mkdir()
    (torn / "used-by.json").write_text('[["/som')
    (tmp_path / "linux-6.1").mkdir()
    link = tmp_path / ("d" * 16)
    link.symlink_to(target)
    others = [torn, tmp_path / "linux-6.1", link]
    use_folder(new, (str(tmp_path / "package"),), others)
    assert all(path.exists() for path in (*others, target))


def test_kernels_of_a_users_file_go_when_it_is_edited(tmp_path):
    """Each edit of it compiles its kernels into another folder."""
    run(tmp_path)
    (before,) = (tmp_path / "cache").rglob("__main__-*")
    global KERNEL
    kept, KERNEL = KERNEL, KERNEL + "\n# an edit\n"
    try:
        run(tmp_path)
    finally:
        KERNEL = kept
    (after,) = (tmp_path / "cache").rglob("__main__-*")
    assert before != after


# ------------------------------------------------------------ where it lies, clearing


@pytest.fixture
def environment(monkeypatch, tmp_path):
    for name in ("LIGHTPROOF_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "tmp"))
    (tmp_path / "tmp").mkdir()
    folders._temporary_root.cache_clear()
    yield monkeypatch
    folders._temporary_root.cache_clear()


def test_the_place_of_the_cache(environment, tmp_path):
    assert cache_root() == tmp_path / ".cache" / "lightproof"
    environment.setenv("XDG_CACHE_HOME", "relative")
    assert cache_root() == tmp_path / ".cache" / "lightproof"
    environment.setenv("XDG_CACHE_HOME", "/elsewhere")
    assert cache_root() == Path("/elsewhere/lightproof")
    environment.setenv("LIGHTPROOF_CACHE", "/here")
    assert cache_root() == Path("/here")


def test_without_a_home_it_is_a_private_temporary_folder(environment, tmp_path):
    """No HOME and no entry in /etc/passwd, or a home that is no folder to write to."""

    def no_home():
        raise RuntimeError("Could not determine home directory.")

    private = tmp_path / "tmp" / f"lightproof-{os.getuid()}"
    environment.setenv("HOME", "/dev/null")
    assert cache_root() == private
    assert private.stat().st_mode & 0o777 == 0o700
    environment.setattr(Path, "home", no_home)
    assert cache_root() == private
    assert cache_folder("kernels").is_dir()


@pytest.mark.parametrize("trap", ["link", "open to others", "file"])
def test_a_temporary_folder_that_others_may_write_to_is_not_used(
    environment, tmp_path, trap
):
    """Kernels are code: from there it could be another user's."""
    environment.setenv("HOME", "/dev/null")
    private = tmp_path / "tmp" / f"lightproof-{os.getuid()}"
    if trap == "link":
        (tmp_path / "target").mkdir()
        private.symlink_to(tmp_path / "target")
    elif trap == "file":
        private.write_text("")
    else:
        private.mkdir()
        private.chmod(0o777)
    root = cache_root()
    assert root != private and root.parent == tmp_path / "tmp"
    assert root.stat().st_mode & 0o777 == 0o700
    assert cache_root() == root


def test_clearing_removes_what_lightproof_made_and_nothing_else(
    environment, tmp_path, capsys
):
    """LIGHTPROOF_CACHE may name a folder with files of the user's."""
    environment.setenv("LIGHTPROOF_CACHE", str(tmp_path))
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "one.png").write_bytes(b"1")
    (tmp_path / "kernels").symlink_to("photos")
    (tmp_path / "mutants").mkdir()
    (tmp_path / "mutants" / "story.txt").write_text("X")
    assert cache_folder("mutants") == tmp_path / "mutants"
    (cache_folder("references") / "a.npz").write_bytes(bytes(2_500_000))
    assert main(["--clear-cache", "--bogus"]) == 2
    assert main(["--clear-cache", "--help"]) == 0
    assert main(["--clear-cache", "scene.xml"]) == 2
    capsys.readouterr()
    assert main(["--clear-cache"]) == 0
    assert capsys.readouterr().out == "removed references: 2 files, 2.5 MB\n"
    assert (tmp_path / "photos" / "one.png").exists()
    assert os.listdir(tmp_path / "mutants") == ["story.txt"]
    assert main(["--clear-cache"]) == 0
    assert capsys.readouterr().out == f"nothing is kept in {tmp_path}\n"
    environment.setenv("LIGHTPROOF_CACHE", str(tmp_path / "nowhere"))
    assert clear_caches() == []


def test_clearing_that_fails_half_way_goes_on_the_next_time(environment, tmp_path, capsys):
    """One line with the whole path; the tag is the last file to go."""
    environment.setenv("LIGHTPROOF_CACHE", str(tmp_path / "lightproof"))
    (cache_folder("kernels") / "a").mkdir()
    (cache_folder("kernels") / "a" / "x").write_text("x")
    remove = shutil.rmtree

    def refuse(path, **options):
        raise PermissionError(errno.EACCES, "Permission denied", str(path / "x"))

    environment.setattr(shutil, "rmtree", refuse)
    assert main(["--clear-cache"]) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"error: {tmp_path / 'lightproof'}: Permission denied: ")
    assert said.endswith("/a/x\n") and said.count("\n") == 1
    environment.setattr(shutil, "rmtree", remove)
    assert main(["--clear-cache"]) == 0
    assert os.listdir(tmp_path / "lightproof") == []


def test_a_cache_that_cannot_be_used_is_said_once(tmp_path):
    """As a file in its place: kernels are compiled each time, which takes seconds."""
    (tmp_path / "cache").write_text("")
    assert run(tmp_path).count("kernels cannot all be kept, and are compiled each") == 1


def test_help_says_where_the_cache_lies(environment, tmp_path, capsys):
    assert main(["--help"]) == 0
    said = capsys.readouterr().out
    assert str(tmp_path / ".cache" / "lightproof") in said
    for word in ("--clear-cache", "LIGHTPROOF_CACHE", "XDG_CACHE_HOME"):
        assert word in said
