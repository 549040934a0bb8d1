"""`--view`: what the server of the page answers, and to whom."""

from __future__ import annotations

import http.client
import json
import socket
import threading
import time

import numpy as np
import pytest

import renderer
from renderer.command import watchers
from renderer.command.cli import main
from renderer.errors import SceneError
from renderer.rendering.film.band import FinishedTiles
from renderer.rendering.picture.image import Image
from renderer.rendering.picture.picture import Picture
from renderer.rendering.progress_display import Progress
from renderer.rendering.watching import live_page
from renderer.rendering.watching.live_page import LivePage

SCENE = {
    "type": "scene",
    "sensor": {
        "type": "perspective",
        "film": {"type": "hdrfilm", "width": 40, "height": 24, "rfilter": {"type": "box"}},
    },
    "sky": {"type": "constant", "radiance": {"type": "rgb", "value": [1.0, 0.5, 0.25]}},
}


def get(page, path, host=None, method="GET"):
    """Return status, headers and content."""
    connection = http.client.HTTPConnection("127.0.0.1", page.port, timeout=10)
    try:
        connection.request(method, path, headers={"Host": host} if host else {})
        answer = connection.getresponse()
        return answer.status, dict(answer.getheaders()), answer.read()
    finally:
        connection.close()


def state_of(page):
    return json.loads(get(page, f"{root(page)}state")[2])


def root(page):
    return page.address.removeprefix(f"http://127.0.0.1:{page.port}")


@pytest.fixture
def page():
    with LivePage("box") as found:
        yield found


def test_the_page_is_one_file_that_asks_nothing_of_others(page):
    status, headers, content = get(page, root(page))
    assert status == 200 and headers["Content-Type"].startswith("text/html")
    text = content.decode()
    assert "http:" not in text.replace("http://www.w3.org", "") and "https:" not in text
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    assert headers["Cache-Control"] == "no-store"
    assert headers["Referrer-Policy"] == "no-referrer"


def test_it_listens_on_this_machine_alone(page):
    assert page._server.server_address[0] == "127.0.0.1"
    with LivePage() as another:
        assert another.address != page.address and another.port != page.port


def test_a_machine_without_a_port_is_one_line(monkeypatch):
    def refuse(*_):
        raise OSError(1, "Operation not permitted")

    monkeypatch.setattr(live_page, "ThreadingHTTPServer", refuse)
    with pytest.raises(SceneError, match=r"no page can be served at .*: Operation"):
        LivePage()


@pytest.mark.parametrize(
    "path", ["/", "/state", "/wrong/", "/wrong/state", "//", "/%2e%2e/"]
)
def test_without_the_token_nothing_is_found(page, path):
    status, _, content = get(page, path)
    assert (status, content) == (404, b"")


def test_no_part_of_a_token_is_enough(page):
    assert len(root(page)) >= 22  # 128 bits
    for wrong in (root(page)[:-2] + "/", root(page)[:-1], root(page).swapcase()):
        assert get(page, wrong)[0] == 404
    assert get(page, f"{root(page)}no-such-thing")[0] == 404
    assert get(page, f"{root(page)}layer/0/0")[0] == 404


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:80", "127.0.0.1", "0.0.0.0:1"]
)
def test_another_host_name_opens_nothing(page, host):
    """A name of another site may lead to 127.0.0.1, and its page know the token never."""
    assert get(page, root(page), host=host)[0] == 404
    for right in (f"127.0.0.1:{page.port}", f"localhost:{page.port}"):
        assert get(page, root(page), host=right)[0] == 200


@pytest.mark.parametrize("method", ["POST", "PUT", "OPTIONS", "HEAD", "TRACE", "FOO"])
def test_other_methods_are_404(page, method):
    assert get(page, root(page), method=method)[0] == 404


def test_what_is_no_http_gets_no_answer(page):
    with socket.create_connection(("127.0.0.1", page.port), timeout=10.0) as connection:
        connection.sendall(b"GET / HTTP/9.9.9\r\n\r\n")
        assert connection.makefile("rb").read() == b""


def picture_of(calls, value=1.0):
    def picture():
        calls.append(value)
        return Picture(np.full((2, 3, 3), value, np.float32))

    return picture


def test_no_picture_is_developed_while_no_page_looks(page, monkeypatch):
    monkeypatch.setattr(live_page, "EVERY", 0.0)
    calls = []
    now = Progress("render", 5, 10, 2.0, picture=picture_of(calls))
    page(now)
    assert calls == []
    state = state_of(page)  # a page looks
    assert (state["stage"], state["done"], state["left"]) == ("render", 5, 2.0)
    assert state["version"] == 0 and state["layers"] == []
    page(now)
    page(now)  # the first one was not fetched yet
    assert calls == [1.0]
    state = state_of(page)
    assert state["version"] == 1 and state["layers"][0]["shape"] == [2, 3, 3]
    _, _, content = get(page, f"{root(page)}layer/1/0")
    np.testing.assert_array_equal(np.frombuffer(content, "<f4"), np.ones(18))
    assert get(page, f"{root(page)}have/1")[0] == 200
    page._next_picture = 0.0
    page(now)
    assert calls == [1.0, 1.0]
    monkeypatch.setattr(live_page, "LOOKS_FOR", 0.0)
    get(page, f"{root(page)}have/2")
    page._next_picture = 0.0
    page(now)
    assert calls == [1.0, 1.0]  # the page was closed


def test_the_finished_picture_waits_for_an_open_page(page):
    image = Image(
        np.ones((2, 3, 3), np.float32), aovs={"n": np.zeros((2, 3, 1), np.float32)}
    )
    state_of(page)
    ended = threading.Thread(target=page.end, args=(image,), kwargs={"patience": 30.0})
    ended.start()
    while not (state := state_of(page))["over"]:
        time.sleep(0.001)
    assert state["stage"] == "finished" and state["version"] == 1
    assert [layer["name"] for layer in state["layers"]] == ["picture", "n"]
    assert ended.is_alive()
    get(page, f"{root(page)}have/1")
    ended.join(timeout=20.0)
    assert not ended.is_alive()


def test_aovs_stay_while_the_colours_around_which_they_are_come(page):
    """Before it the picture is black, and is no layer; another size is another picture."""

    def names():
        return [layer.name for layer in page._snapshot.layers]

    black, aov = np.zeros((2, 3, 3)), {"n": np.ones((2, 3, 1))}
    page._put(black, aov, {})
    assert names() == ["n"]
    page._put(black + 1.0, {}, {})
    assert names() == ["picture", "n"]
    page._put(black + 2.0, {}, {})
    assert page._snapshot.layers[0].values.max() == 2.0
    page._put(np.zeros((4, 4, 3)), {}, {})
    assert names() == ["picture"]


def test_the_port_is_closed_with_the_page():
    with LivePage() as page:
        assert get(page, root(page))[0] == 200
    with pytest.raises(OSError):
        socket.create_connection(("127.0.0.1", page.port), timeout=1.0)


def test_the_last_progress_of_a_render_has_its_picture():
    """And AOVs; pictures so far change no bit of it."""
    scene = renderer.load_dict(SCENE)
    seen = []

    def watch(now):
        if now.picture is not None:
            seen.append(now.picture().pixels)

    plain = renderer.render(scene, spp=64)
    image = renderer.render(scene, spp=64, progress=watch)
    np.testing.assert_array_equal(seen[-1], image.pixels)
    np.testing.assert_array_equal(plain.pixels, image.pixels)


def test_looking_at_finished_tiles_takes_none_of_them_away(monkeypatch):
    """Tiles whose sums are not kept: `Film.develop` would blacken what ends meanwhile."""
    wide = {"type": "hdrfilm", "width": 160, "height": 150, "rfilter": {"type": "box"}}
    scene = renderer.load_dict(SCENE | {"sensor": SCENE["sensor"] | {"film": wide}})
    seen = []
    finish = FinishedTiles.finish

    def finish_and_look(film, strip, sums):
        finish(film, strip, sums)
        seen.append(film.so_far().copy())  # before the film knows that they are finished

    expected = renderer.render(scene, 1).pixels
    monkeypatch.setattr(FinishedTiles, "finish", finish_and_look)
    image = renderer.render(scene, 1)
    np.testing.assert_array_equal(image.pixels, expected)
    assert len(seen) > 1  # it was a render of finished tiles
    for picture in seen:
        known = picture.any(axis=2)
        np.testing.assert_array_equal(picture[known], expected[known])


def test_the_command_says_the_address_and_closes_the_port(tmp_path, capsys, monkeypatch):
    opened = []
    monkeypatch.setattr(watchers, "_open_browser", opened.append)
    monkeypatch.setattr(LivePage.end, "__defaults__", (0.0,))  # for no page
    (tmp_path / "scene.xml").write_text(
        '<scene version="3.0.0"><sensor type="perspective"><film type="hdrfilm">'
        '<integer name="width" value="8"/><integer name="height" value="6"/></film>'
        '</sensor><emitter type="constant"/></scene>'
    )
    monkeypatch.chdir(tmp_path)
    output, words = tmp_path / "a.png", ["scene.xml", "--view", "--quiet"]
    assert main([*words, "-o", str(output)]) == 0
    (address,) = opened
    assert output.exists() and main([*words, "--frames", "0:2", "-o", "f_#.png"]) == 0
    assert len(opened) == 2  # one page for all frames
    assert f"view: {address}\n" in capsys.readouterr().err
    port = int(address.split(":")[2].split("/")[0])
    with pytest.raises(OSError):
        socket.create_connection(("127.0.0.1", port), timeout=1.0)
