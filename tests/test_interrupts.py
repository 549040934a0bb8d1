"""Ctrl-C that Python itself would lose, or make an error of another kind of."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
import weakref
from collections.abc import Iterator
from pathlib import Path

import pytest

from renderer.command import cli
from renderer.command.interrupts import Interrupts

ROOT = Path(__file__).parent.parent


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
    finished = subprocess.run(
        [sys.executable, "-c", WATCHED, scene, *size, "-o", tmp_path / "ball.exr"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert finished.returncode == 0, finished.stderr
    assert finished.stdout.split("bare:")[1].split() == []
