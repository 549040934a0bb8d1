"""Kernels that a wheel carries: found before anything is compiled, never written."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest
from compiled_kernels import ROOT
from processes import run_python

from renderer.kernels.jit import cache
from renderer.kernels.jit.cache import LEVELS, runs, shipped_for_this_processor

PROGRAM = """
import logging, sys
from pathlib import Path
logging.basicConfig(stream=sys.stdout, format="%(message)s")
from numba import config
from renderer.kernels.jit import cache
cache.SHIPPED = Path(__file__).parent / "compiled"
told = config.CPU_NAME, config.CPU_FEATURES
from renderer.kernels.jit import entry_kernel

@entry_kernel
def triple(x):
    return 3 * x

assert triple(2) == 6 and triple(2.0) == 6.0
for word in sys.argv[1:]:
    triple(complex(word))
assert (config.CPU_NAME, config.CPU_FEATURES) == told
print(len(triple.stats.cache_hits), "hits")
"""

pytestmark = pytest.mark.skipif(
    not runs("x86-64-v3"), reason="this processor is not an x86-64-v3"
)


def run(folder: Path, cache: str, *words: str, **told: str) -> str:
    """Compile or load two kernels in a process of its own; return what it printed."""
    environment = {"LIGHTPROOF_CACHE": str(folder / cache), "PYTHONPATH": str(ROOT)}
    done = run_python(
        "program.py",
        *words,
        folder=folder,
        environment=os.environ | environment | told,
        check=True,
    )
    return done.stdout


def for_level(level: str) -> dict[str, str]:
    """Return the environment in which Numba compiles for a level."""
    return {"NUMBA_CPU_NAME": level, "NUMBA_CPU_FEATURES": LEVELS[level]}


@pytest.fixture(scope="module")
def builders(tmp_path_factory) -> Path:
    """A folder with a program and the cache of its kernels for x86-64-v3."""
    folder = tmp_path_factory.mktemp("builders")
    (folder / "program.py").write_text(PROGRAM)
    assert run(folder, "built", **for_level("x86-64-v3")) == "0 hits\n"
    return folder


@pytest.fixture
def users(builders, tmp_path) -> Path:
    """Another folder, with the program and its kernels as a wheel carries them."""
    shutil.copy(builders / "program.py", tmp_path)
    (kernels,) = (builders / "built" / "kernels").glob("[0-9a-f]" * 16)
    target = tmp_path / "compiled" / kernels.name / "x86-64-v3"
    shutil.copytree(kernels, target, copy_function=shutil.copyfile)  # with times of now
    return tmp_path


def kept(folder: Path) -> list[Path]:
    return sorted((folder / "cache").rglob("*.nbc"))


def test_a_shipped_kernel_is_not_compiled(users) -> None:
    before = {path: path.read_bytes() for path in (users / "compiled").rglob("*.nb?")}
    assert len(before) == 3
    assert run(users, "cache") == "2 hits\n"
    assert kept(users) == []
    assert before == {path: path.read_bytes() for path in before}


def test_a_kernel_that_is_not_shipped_goes_to_the_users_cache(users) -> None:
    """For a type that the builder did not have; it is found there the next time."""
    assert run(users, "cache", "1j") == "2 hits\n"
    assert len(kept(users)) == 1
    assert run(users, "cache", "1j") == "3 hits\n"


def test_where_the_user_keeps_none_the_shipped_are_found(users) -> None:
    (users / "cache").write_text("no folder")
    said = run(users, "cache", "1j").splitlines()
    assert said[-1] == "2 hits"
    assert len(said) == 2 and said[0].startswith("kernels cannot all be kept")


def test_the_users_own_kernels_come_first(users) -> None:
    """Those of the very processor, once they are there."""
    shutil.move(users / "compiled", users / "away")
    assert run(users, "cache") == "0 hits\n"
    shutil.move(users / "away", users / "compiled")
    for path in (users / "compiled").rglob("*.nb?"):
        path.write_bytes(b"damaged, and never read")
    assert run(users, "cache") == "2 hits\n"


@pytest.mark.parametrize("ending", [".nbi", ".nbc"])
def test_a_damaged_shipped_kernel_is_compiled_with_one_warning(users, ending) -> None:
    """It stays as it is, and the user's cache has the kernel from then on."""
    for path in (users / "compiled").rglob(f"*{ending}"):
        path.write_bytes(path.read_bytes()[:-3])
    said = run(users, "cache")
    assert said.count("kernels are compiled again") == 1
    assert said.endswith("is damaged\n0 hits\n")
    assert run(users, "cache") == "2 hits\n"


def test_a_folder_in_the_place_of_a_shipped_index_is_one_warning(users) -> None:
    """As a file that may not be read would be."""
    (index,) = (users / "compiled").rglob("*.nbi")
    index.unlink()
    index.mkdir()
    said = run(users, "cache").splitlines()
    assert len(said) == 2 and said[0].startswith("kernels are compiled again")
    assert said[1] == "0 hits"


def test_kernels_of_another_version_are_not_looked_at_with_one_warning(users) -> None:
    (kernels,) = (users / "compiled").iterdir()
    kernels.rename(kernels.with_name("0" * 16))
    said = run(users, "cache").splitlines()
    assert len(said) == 2 and said[1] == "0 hits"
    assert "another version of Python or Numba" in said[0]


def levels_for(sources: str) -> list[str]:
    """Return the levels that are looked at, in order."""
    return [level for level, _ in shipped_for_this_processor.__wrapped__(sources)]


def test_the_highest_level_that_the_processor_has_is_the_first(
    monkeypatch, tmp_path
) -> None:
    """Kernels of a level that it lacks would end the process."""
    for level in ("x86-64-v3", "x86-64-v4"):
        (tmp_path / "sources" / level).mkdir(parents=True)
    monkeypatch.setattr(cache, "SHIPPED", tmp_path)
    monkeypatch.setattr(cache, "runs", lambda level: True)
    assert levels_for("sources") == ["x86-64-v4", "x86-64-v3"]
    monkeypatch.setattr(cache, "runs", lambda level: level == "x86-64-v3")
    assert levels_for("sources") == ["x86-64-v3"]
    monkeypatch.setattr("numba.core.config.CPU_NAME", "generic")  # as the user told Numba
    assert levels_for("sources") == []


def test_a_level_is_run_with_all_its_features_alone(monkeypatch) -> None:
    features = dict.fromkeys((name[1:] for name in LEVELS["x86-64-v3"].split(",")), True)
    monkeypatch.setattr("llvmlite.binding.get_host_cpu_features", lambda: features)
    assert [runs(level) for level in LEVELS] == [False, True]
    for name in features:
        monkeypatch.setitem(features, name, False)
        assert not runs("x86-64-v3")
        monkeypatch.setitem(features, name, True)
