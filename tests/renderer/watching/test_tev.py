"""`--tev`: a stand-in for tev receives the packets and puts the picture together."""

from __future__ import annotations

import socket
import struct
import threading

import numpy as np
import pytest

import renderer
from renderer.command.cli import main
from renderer.errors import SceneError
from renderer.rendering.picture.picture import Picture
from renderer.rendering.progress_display import Progress
from renderer.rendering.watching import tev
from renderer.rendering.watching.tev import Tev


class FakeTev:
    """Listens as tev does, and reads packets by the format that its sources say."""

    def __init__(self):
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = self._listening.getsockname()[1]
        self.pictures, self.tiles, self.closed = {}, [], []
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self):
        connection, _ = self._listening.accept()
        with connection, connection.makefile("rb") as file:
            while head := file.read(4):
                (size,) = struct.unpack("<I", head)
                self._read(file.read(size - 4))

    def end(self):
        self._thread.join(timeout=30.0)
        self._listening.close()

    def _read(self, content):
        self._content, self._at = content, 0
        kind = self._numbers("<b")[0]
        if kind == 2:  # close
            self.closed.append(self._text())
            return
        assert self._numbers("<b")[0] in (0, 1)  # grab the focus
        name = self._text()
        if kind == 4:  # create
            width, height, count = self._numbers("<iii")
            channels = [self._text() for _ in range(count)]
            self.pictures[name] = {c: np.full((height, width), -1.0) for c in channels}
        else:
            assert kind == 6  # update
            (count,) = self._numbers("<i")
            channels = [self._text() for _ in range(count)]
            x, y, width, height = self._numbers("<iiii")
            offsets = self._numbers(f"<{count}q")
            strides = self._numbers(f"<{count}q")
            numbers = np.frombuffer(content[self._at :], "<f4")
            for channel, offset, stride in zip(channels, offsets, strides, strict=True):
                part = numbers[offset::stride][: width * height].reshape(height, width)
                picture = self.pictures[name][channel]
                picture[y : y + height, x : x + width] = part
            self.tiles.append((x, y, width, height))
            self._at = len(content)
        assert self._at == len(content)

    def _numbers(self, form):
        found = struct.unpack_from(form, self._content, self._at)
        self._at += struct.calcsize(form)
        return found

    def _text(self):
        end = self._content.index(b"\0", self._at)
        found = self._content[self._at : end].decode()
        self._at = end + 1
        return found


@pytest.fixture
def fake():
    found = FakeTev()
    yield found
    found.end()


def picture_of(pixels):
    normals = {"n": pixels[:, :, :1] * 2}
    return Picture(pixels.astype(np.float32), normals, {"n": "depth"})


def test_only_tiles_that_changed_are_sent(fake, monkeypatch):
    monkeypatch.setattr(tev, "EVERY", 0.0)
    rng = np.random.default_rng(1)
    pixels = rng.random((70, 130, 3)).astype(np.float32)
    with Tev("127.0.0.1", fake.port, "box") as sender:
        sender(Progress("render", 0, 9, 0.0, picture=lambda: picture_of(pixels)))
        sender(Progress("render", 3, 9, 1.0, picture=lambda: picture_of(pixels)))
        changed = pixels.copy()
        changed[69, 129] = 7.0
        sender.end(picture_of(changed))
    fake.end()
    corners = [(x, y) for y in (0, 64) for x in (0, 64, 128)]
    assert [tile[:2] for tile in fake.tiles] == [*corners, (128, 64)]
    assert fake.tiles[-1] == (128, 64, 2, 6)
    found = fake.pictures["box"]
    assert sorted(found) == ["B", "G", "R", "n.T"]
    for number, channel in enumerate("RGB"):
        np.testing.assert_array_equal(found[channel], changed[:, :, number])
    np.testing.assert_array_equal(found["n.T"], 2 * changed[:, :, 0])


def test_another_size_is_another_picture(fake):
    with Tev("127.0.0.1", fake.port, "box") as sender:
        sender.end(picture_of(np.ones((4, 5, 3))))
        sender.end(picture_of(np.zeros((6, 7, 3))))
    fake.end()
    assert fake.closed == ["box"]
    assert (fake.pictures["box"]["R"] == np.zeros((6, 7))).all()


def test_the_command_sends_the_picture_that_it_writes(fake, tmp_path):
    (tmp_path / "scene.xml").write_text(
        '<scene version="3.0.0"><sensor type="perspective"><film type="hdrfilm">'
        '<integer name="width" value="80"/><integer name="height" value="66"/></film>'
        '</sensor><emitter type="constant"/><shape type="sphere"><point name="center" '
        'x="0" y="0" z="4"/></shape></scene>'
    )
    words = [str(tmp_path / "scene.xml"), "-o", str(tmp_path / "a.npy"), "--quiet"]
    assert main([*words, "--tev", f"127.0.0.1:{fake.port}"]) == 0
    fake.end()
    (name,) = fake.pictures
    assert name == tmp_path.name
    found = np.stack([fake.pictures[name][channel] for channel in "RGB"], axis=2)
    np.testing.assert_array_equal(found, np.load(tmp_path / "a.npy"))


def test_where_nothing_listens_is_one_line(tmp_path, capsys):
    with socket.create_server(("127.0.0.1", 0)) as closed:
        port = closed.getsockname()[1]
    with pytest.raises(SceneError, match=f"no tev at 127.0.0.1:{port}: .*; start it first"):
        Tev("127.0.0.1", port, "box")
    assert main(["scene.xml", "--tev", "scene.xml"]) == 2
    said = capsys.readouterr().err
    assert "'scene.xml' is not HOST:PORT" in said and len(said.splitlines()) == 1


def test_a_tev_that_is_closed_does_not_stop_the_render(monkeypatch):
    monkeypatch.setattr(tev, "EVERY", 0.0)
    listening = socket.create_server(("127.0.0.1", 0))
    scene = renderer.load_dict(
        {
            "type": "scene",
            "sensor": {
                "type": "perspective",
                "film": {"type": "hdrfilm", "width": 300, "height": 200},
            },
            "sky": {"type": "constant"},
        }
    )
    with Tev("127.0.0.1", listening.getsockname()[1], "sky") as sender:
        listening.accept()[0].close()
        listening.close()
        image = renderer.render(scene, spp=8, progress=sender)
        sender.end(image)
        sender.end(image)
        assert image.complete and sender.trouble
