"""Ctrl-C that Python itself would lose, or make an error of another kind of."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
import weakref
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from processes import run_python

from renderer import __main__
from renderer.command import cli
from renderer.command.interrupts import Interrupts
from renderer.process.signals import put_off_interrupts

ROOT = Path(__file__).parents[3]
BOX = ROOT / "scenes" / "cornell-box" / "scene.xml"


@pytest.fixture(autouse=True)
def _listening() -> Iterator[None]:
    """Also where the tests run in a shell's background, which ignores SIGINT."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


class Thing:
    """Something that can be weakly referred to."""


def interrupted_in_a_callback() -> None:
    """Raise SIGINT where Python prints and forgets what is raised."""
    thing = Thing()
    reference = weakref.ref(thing, lambda _: signal.raise_signal(signal.SIGINT))
    del thing
    assert reference() is None


@pytest.mark.usefixtures("no_collection")
def test_an_interrupt_in_a_weak_references_callback_comes_again(capfd) -> None:
    """Numba has such callbacks: one Ctrl-C of 63 was lost in one, and a traceback shown."""
    with pytest.raises(KeyboardInterrupt), Interrupts() as interrupts:
        interrupted_in_a_callback()
        for _ in range(1000):
            time.sleep(0.01)
    assert interrupts.count == 1
    assert capfd.readouterr().err == ""
    assert sys.unraisablehook is not interrupts._on_lost


def test_what_an_interrupt_leaves_half_made_is_not_taken_apart(monkeypatch) -> None:
    """llvmlite's objects fail, or crash, when they go without having been made."""
    monkeypatch.setattr("renderer.command.interrupts._HALF_DONE", kept := [])
    gone = []

    class HalfMade:
        def __init__(self) -> None:
            signal.raise_signal(signal.SIGINT)

        def __del__(self) -> None:
            gone.append(self)

    def command() -> int:
        try:
            with Interrupts():
                HalfMade()
        except KeyboardInterrupt:
            return 130
        return 0

    assert command() == 130
    assert len(kept) == 1 and not gone
    kept.clear()
    assert gone


def test_errors_that_are_not_an_interrupts_are_let_go(monkeypatch) -> None:
    """With all that their frames hold, such as pictures, also after an interrupt."""
    monkeypatch.setattr("renderer.command.interrupts._HALF_DONE", kept := [])
    for error in (ValueError("a"), KeyboardInterrupt(), ImportError("b")):
        with pytest.raises(type(error)), Interrupts() as interrupts:
            interrupts.held = True
            signal.raise_signal(signal.SIGINT)
            try:
                if isinstance(error, ImportError):
                    raise KeyboardInterrupt
            finally:
                raise error
    assert list(map(type, kept)) == [KeyboardInterrupt, ImportError]


def test_other_errors_that_are_lost_are_still_shown(monkeypatch) -> None:
    shown = []
    monkeypatch.setattr(sys, "unraisablehook", shown.append)

    class Faulty:
        def __del__(self) -> None:
            raise ValueError("lost")

    with Interrupts():
        Faulty()
    assert [str(one.exc_value) for one in shown] == ["lost"]


def test_an_import_that_an_interrupt_broke_is_no_traceback(monkeypatch, capsys) -> None:
    """C code that imports answers an interrupt with an ImportError of its own."""

    def run(options, interrupts, written):
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt as error:
            raise ImportError("numba._devicearray") from error

    monkeypatch.setattr(cli, "_run", run)
    assert cli.main(["scene.xml"]) == 130
    assert capsys.readouterr().err == "interrupted; wrote nothing\n"


def test_an_interrupt_is_put_off_until_an_import_is_over() -> None:
    after = False
    with pytest.raises(KeyboardInterrupt), Interrupts() as interrupts:
        with interrupts.put_off():
            signal.raise_signal(signal.SIGINT)
            after = True
        pytest.fail("the interrupt was lost")
    assert after and not interrupts.held


def test_an_import_that_fails_by_itself_is_shown(monkeypatch) -> None:
    def run(options, interrupts, written):
        raise ImportError("no such module")

    monkeypatch.setattr(cli, "_run", run)
    with pytest.raises(ImportError, match="no such module"):
        cli.main(["scene.xml"])


WATCHED = """
import sys
from renderer.command import cli

bare, made = [], []

class Noted(cli.Interrupts):
    def __init__(self):
        super().__init__()
        made.append(self)

class Finder:
    def find_spec(self, name, path, target=None):
        if name in ("numpy", "numba", "llvmlite.binding", "OpenEXR") and not made[0].held:
            bare.append(name)

cli.Interrupts = Noted
sys.meta_path.insert(0, Finder())
assert cli.main(sys.argv[1:]) == 0
print("bare:", *bare)
"""


def test_what_has_c_code_is_imported_while_interrupts_are_put_off(tmp_path) -> None:
    scene = ROOT / "scenes" / "grey-furnace" / "scene.xml"
    size = ("-D", "width=8", "-D", "height=6", "--spp", "1", "--quiet")
    finished = run_python(
        "-c", WATCHED, scene, *size, "-o", tmp_path / "ball.exr", folder=ROOT, check=True
    )
    assert finished.stdout.split("bare:")[1].split() == []


# ------------------------------------------------- where LLVM calls back into Python

_DISTURBED = """
import signal, sys
from numba.core import codegen
from numba.core.registry import cpu_target
from renderer.kernels.jit import entry_kernel
from twice import twice

library = codegen.JITCodeLibrary
engine = cpu_target.target_context.codegen()._engine
notify, get = library._object_compiled_hook, library._object_getbuffer_hook
disturbed, calls = False, []

def around(hook):
    def called(*given):
        calls.append(hook.__name__)
        if disturbed:
            signal.raise_signal(signal.SIGINT)
        return hook(*given)
    return called

engine.set_object_cache(around(notify), around(get))
signal.signal(signal.SIGINT, signal.default_int_handler)
for way in ("compiled", "from the cache"):
    for disturbed in (True, False):
        try:
            print(way, entry_kernel(twice)(21), flush=True)
        except KeyboardInterrupt:
            print(way, "interrupted", flush=True)
print(len(set(calls)))
"""


def test_an_interrupt_while_llvm_calls_back_is_raised_after_it(tmp_path: Path) -> None:
    """Lost in the callback, it left a kernel without code: a segmentation fault.

    One kernel is compiled, then read from the cache, with an interrupt in each callback,
    then without. In a process of its own, because that is what the fault ended.
    """
    (tmp_path / "twice.py").write_text("def twice(x):\n    return 2 * x\n")
    paths = [str(ROOT), str(tmp_path)]
    given = {"PYTHONPATH": os.pathsep.join(paths), "LIGHTPROOF_CACHE": str(tmp_path)}
    done = run_python("-c", _DISTURBED, environment={**os.environ, **given})
    ways = ("compiled", "from the cache")
    lines = [f"{way} {found}" for way in ways for found in ("interrupted", 42)]
    assert (done.stdout.splitlines(), done.stderr) == ([*lines, "2"], "")
    assert done.returncode == 0


@pytest.mark.parametrize("times", [0, 1, 2])
def test_put_off_interrupts_come_after_the_block(times: int) -> None:
    seen = []
    signal.signal(signal.SIGINT, lambda number, frame: seen.append(number))
    with put_off_interrupts():
        with put_off_interrupts():
            for _ in range(times):
                signal.raise_signal(signal.SIGINT)
        assert seen == []
    assert seen == [signal.SIGINT] * times


def test_an_ignored_interrupt_stays_ignored() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with put_off_interrupts():
        signal.raise_signal(signal.SIGINT)
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN


_DEAF = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.SIG_IGN)
os.execv(sys.executable, [sys.executable, "-m", "renderer", *sys.argv[1:]])
"""


def test_a_process_that_ignores_interrupts_renders_to_its_end(tmp_path: Path) -> None:
    """As one does that a shell's script started with `&`; it is hit all the time."""
    words = [str(BOX), "-D", "width=32", "-D", "height=32", "--spp", "64", "-o", "a.npy"]
    process = subprocess.Popen(
        [sys.executable, "-c", _DEAF, *words],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert process.stdout is not None
    said = process.stdout.readline()  # it is no longer the program that ignores them
    while process.poll() is None:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(0.02)
        except subprocess.TimeoutExpired:
            pass
    said += process.stdout.read()
    process.stdout.close()
    assert (process.returncode, "interrupted" in said) == (0, False), said
    assert np.load(tmp_path / "a.npy").shape[:2] == (32, 32)


def test_the_last_lines_of_a_process_ignore_interrupts_too(monkeypatch) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    monkeypatch.setattr(os, "_exit", lambda status: None)
    __main__._end(0)
    assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN


def test_an_interrupt_while_the_command_line_is_read(monkeypatch, capsys) -> None:
    def interrupted(arguments: object) -> None:
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(cli, "read_options", interrupted)
    assert cli.main([]) == 130
    assert capsys.readouterr().err == "interrupted; wrote nothing\n"
