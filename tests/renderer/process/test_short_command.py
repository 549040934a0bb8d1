"""Commands that are over soon: what they refuse is one line, and Ctrl-C has a status."""

from __future__ import annotations

import pytest

from renderer.errors import SceneError
from renderer.process.short_command import INTERRUPTED, WRONG_USE, run_command


def raised(error):
    def run():
        raise error

    return run


def test_the_status_is_that_of_the_work(capsys):
    assert run_command("lightproof x", lambda: 1) == 1
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("error", "status", "line"),
    [
        (KeyboardInterrupt(), INTERRUPTED, ""),
        (SceneError("a.xml:3: no"), WRONG_USE, "lightproof x: a.xml:3: no\n"),
        (
            OSError(28, "No space left on device", "a\n.png"),
            WRONG_USE,
            "lightproof x: a\\x0a.png: No space left on device\n",
        ),
        (OSError(32, "Broken pipe"), WRONG_USE, "lightproof x: output: Broken pipe\n"),
    ],
)
def test_what_ends_it_is_one_line(capsys, error, status, line):
    assert run_command("lightproof x", raised(error)) == status
    assert capsys.readouterr() == ("", line)


def test_another_error_is_not_hidden():
    with pytest.raises(ZeroDivisionError):
        run_command("lightproof x", lambda: 1 // 0)
