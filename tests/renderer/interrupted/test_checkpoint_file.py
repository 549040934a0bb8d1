"""The file of a checkpoint: cut off or changed anywhere, it is known; the older is there.

What a power cut leaves is a file that ends anywhere, or a name that was not changed: both
are made here, one by one.
"""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path

import numpy as np
import pytest

from renderer.process.whole_file import remove_parts
from renderer.rendering.checkpoints.file import (
    LENGTH,
    MAGIC,
    Damaged,
    find_checkpoint,
    older,
    read_checkpoint,
    write_checkpoint,
)

OF = {"said": {"seed": "3"}, "hashed": {"shapes": "0" * 64}}


def arrays(value):
    return {
        "sums": np.full((2, 3), value, np.float64),
        "samples": np.array([value], np.int64),
        "none": np.zeros((0, 4), np.float32),
    }


def value_in(stored):
    found = {name: np.empty(a.shape, a.dtype) for name, a in stored.arrays.items()}
    stored.read_into(found)
    first = found["samples"][0]
    assert (found["sums"] == first).all(), f"sums and samples are of two states: {first}"
    return int(found["samples"][0])


def write(path, value):
    write_checkpoint(path, OF, arrays(value), keep=path.exists())


@pytest.fixture
def path(tmp_path):
    """Two checkpoints, 2 and the older 1."""
    path = tmp_path / "a.ckpt"
    write(path, 1)
    write(path, 2)
    return path


def test_what_is_written_is_read(path):
    stored, wrong = find_checkpoint(path)
    assert (stored.path, stored.of, wrong) == (path, OF, [])
    assert value_in(stored) == 2
    assert value_in(read_checkpoint(older(path))) == 1
    assert sorted(os.listdir(path.parent)) == ["a.ckpt", "a.ckpt.older"]


def test_nothing_is_there(tmp_path):
    assert find_checkpoint(tmp_path / "a.ckpt") == (None, [])


def test_a_file_that_ends_anywhere_is_known_and_the_older_is_read(path):
    """Every length that is too short; and one byte too much."""
    whole = path.read_bytes()
    for length in range(len(whole)):
        path.write_bytes(whole[:length])
        stored, wrong = find_checkpoint(path)
        assert value_in(stored) == 1 and len(wrong) == 1, length
    path.write_bytes(whole + b"\0")
    assert value_in(find_checkpoint(path)[0]) == 1


def test_a_bit_that_has_flipped_anywhere_is_known(path):
    whole = path.read_bytes()
    for place in range(len(whole)):
        changed = bytearray(whole)
        changed[place] ^= 1 << place % 8
        path.write_bytes(changed)
        assert value_in(find_checkpoint(path)[0]) == 1, place


def test_both_are_damaged(path):
    for file in (path, older(path)):
        file.write_bytes(file.read_bytes()[:-1])
    stored, wrong = find_checkpoint(path)
    assert stored is None
    assert wrong == [
        f"{path} is damaged: its checksum is wrong",
        f"{older(path)} is damaged: its checksum is wrong",
    ]


@pytest.mark.parametrize("content", [b"", b"PNG", b"\0" * 4096, MAGIC])
def test_what_is_no_checkpoint(tmp_path, content):
    path = tmp_path / "a.ckpt"
    path.write_bytes(content)
    with pytest.raises(Damaged):
        read_checkpoint(path)


def test_a_pipe_in_its_place_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "a.ckpt")
    assert find_checkpoint(tmp_path / "a.ckpt")[1] == [f"{tmp_path}/a.ckpt is no file"]


@pytest.mark.parametrize(
    "header",
    [
        "[]",
        "{}",
        "{",
        "[" * 100000,
        '{"of": [], "arrays": []}',
        '{"of": {"said": 3}, "arrays": []}',
        '{"of": {}, "arrays": [["sums", "<f8", [1000000000000, 1000000000000]]]}',
        '{"of": {}, "arrays": [["sums", "<f8", [-1]]]}',
        '{"of": {}, "arrays": [["sums", "no type", [1]]]}',
        '{"of": {}, "arrays": [["sums", "O", [1]]]}',
        '{"of": {}, "arrays": [["sums", "f8,(", [1]]]}',
        '{"of": {}, "arrays": [["sums", "<f8", [Infinity]]]}',
        '{"of": {}, "arrays": [["more", "<f8", [-1]], ["sums", "<f8", [1]]]}',
        '{"of": {}, "arrays": [["sums"]]}',
    ],
)
def test_a_header_that_lies_costs_nothing(tmp_path, header):
    """Its checksum is right, as an accident does not make it."""
    path = tmp_path / "a.ckpt"
    body = MAGIC + len(header).to_bytes(LENGTH, "little") + header.encode()
    path.write_bytes(body + hashlib.sha256(body).digest())
    with pytest.raises(Damaged):
        read_checkpoint(path)


def test_a_header_longer_than_the_file(tmp_path):
    path = tmp_path / "a.ckpt"
    body = MAGIC + b"\xff" * LENGTH + json.dumps({}).encode()
    path.write_bytes(body + hashlib.sha256(body).digest())
    with pytest.raises(Damaged, match="longer than the file"):
        read_checkpoint(path)


class PowerCut(BaseException):
    """After it not even `finally` runs."""


@pytest.mark.parametrize(
    ("step", "left"),
    [(0, 2), (1, 2), (2, 2), (3, 3)],
    ids=["before the data", "before the names", "between the names", "before the folder"],
)
def test_a_power_cut_between_any_two_steps(path, monkeypatch, step, left):
    """The new one is 3; what is found then, and that the next one can be written."""
    steps = []

    def cut_off(call):
        def counted(*arguments):
            if len(steps) == step:
                raise PowerCut
            steps.append(call)
            return call(*arguments)

        return counted

    with monkeypatch.context() as context:
        for name in ("fsync", "replace"):
            context.setattr(os, name, cut_off(getattr(os, name)))
        context.setattr(Path, "unlink", lambda self, missing_ok: None)
        with pytest.raises(PowerCut):
            write(path, 3)
    stored, wrong = find_checkpoint(path)
    assert value_in(stored) == left and not wrong
    remove_parts(path)
    assert not list(path.parent.glob(".*"))
    write(path, 4)
    assert value_in(find_checkpoint(path)[0]) == 4


def test_parts_of_others_stay(tmp_path):
    """Of a picture whose name begins so, and of a process that lives: our parent."""
    names = [".night.exr.77.part", ".night.77.png.part", f".night.{os.getppid()}.part"]
    gone = [f".night.{number}.part" for number in (os.getpid(), 2**22 + 1, 10**30)]
    for name in names + gone:
        (tmp_path / name).touch()
    remove_parts(tmp_path / "night")
    assert sorted(os.listdir(tmp_path)) == sorted(names)
