"""The study of scenes, the index and the page of a scene, from hand-made results."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from report_samples import compared, replay, scene, stopped_scene, write_results

from mitsuba_ref.records.verdicts import COMPARED, VERDICTS
from reports.bench.study import Bench
from reports.errors import ReportError
from reports.look.results import read_results
from reports.studies.scenes import STUDY, session

HOSTILE = (
    """</script><script>alert(1)</script><img src=x onerror="alert('2')">{{ 7 * 7 }}"""
)


class Outline(HTMLParser):
    """Collects tags, addresses, handlers of events and text."""

    def __init__(self, page):
        super().__init__()
        self.tags, self.addresses, self.handlers, self.text = [], [], [], ""
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.addresses += [v for name, v in attrs if name in ("href", "src", "data-page")]
        self.handlers += [name for name, _ in attrs if name.startswith("on")]

    def handle_data(self, data):
        self.text += data


def read(folder, name="index.html"):
    return (folder / name).read_text(encoding="utf-8")


def test_rows_hold_verdict_error_seconds_and_times_as_fast(tmp_path):
    """Of equal sample counts Mitsuba takes four times as long to the same error."""
    table = compared(tmp_path, scene("box", "pass")).read("scenes")
    values = {
        (row.quantity, row.contender): row.value for row in table if row.quantity != "x"
    }
    assert values["verdict", ""] == "pass"
    assert (values["RMSE", ""], values["noise floor", ""]) == (0.021, 0.02)
    assert values["tolerance", ""] == 0.025
    assert (values["seconds", "lightproof"], values["seconds", "Mitsuba"]) == (0.31, 2.4)
    (times,) = table.where(quantity="times as fast")
    assert [times.value, *times.interval] == pytest.approx([4.0] * 3)
    pictures = [row.value for row in table.where(quantity="picture")]
    assert len(pictures) == 6 and all((tmp_path / path).is_file() for path in pictures)
    assert "1 of 1 scenes agree with Mitsuba; to the same error 4" in STUDY.verdict(table)


def test_the_index_says_the_verdict_first_and_shows_failing_scenes_first(tmp_path):
    """Order of the cases: pass, fail, error, pass. On the page: what needs eyes first."""
    names = "sound", "shifted", "broken", "solid"
    kinds = scene, scene, stopped_scene, scene
    verdicts = ("pass",), ("fail",), (), ("pass",)
    made = [kind(n, *v) for kind, n, v in zip(kinds, names, verdicts, strict=True)]
    compared(tmp_path, *made)
    page = read(tmp_path)
    assert page.index("2 of 4 scenes agree") < page.index('<main id="content">')
    assert "lightproof is 4 times as fast" in page
    assert "a geometric mean over 2 scenes with noise" in page  # that pass
    assert re.findall(r'<article class="card \w+" id="(\w+)"', page) == [
        "shifted", "broken", "solid", "sound",
    ]  # fmt: skip
    rows = re.findall(r'<tr><th scope="row"><a href="scene_(\w+)\.html">', page)
    assert rows == ["shifted", "broken", "solid", "sound"]
    assert '--value: 0.8400; --floor: 0.8000"' in page  # of the tolerance, 0.025
    assert "beyond its limit: RMSE" in page
    assert "is not supported" in page
    assert len(page) < 1e6


@pytest.mark.parametrize("verdict", VERDICTS)
def test_every_verdict_has_a_card_and_a_page(tmp_path, verdict):
    """Scenes that stopped come without pictures; "error" is of older versions."""
    made = scene if verdict in COMPARED else lambda name, _: stopped_scene(name)
    compared(tmp_path, made("one", verdict) | {"verdict": verdict})
    badge = f'<span class="badge {verdict if verdict in ("pass", "fail") else "error"}">'
    assert badge in read(tmp_path) and badge in read(tmp_path, "scene_one.html")


def test_a_failure_is_a_table_with_limits_on_the_page_of_its_scene(tmp_path):
    """Metrics within their limits say nothing of why a replay failed."""
    step = {
        "x": 7, "y": 9, "sample": 2, "place": "bounce 0", "quantity": "BSDF pdf",
        "ours": "0.60597", "reference": "0.30298", "error": 0.5, "limit": 1e-5,
        "within_rounding": False, "likely": "a value",
    }  # fmt: skip
    parted = replay(1, 9, divergent_allowed=0, verdict="fail", rmse=2e-4, partings=[step])
    entry = scene("one", "pass") | {"verdict": "fail", "reasons": ["LONG"]}
    compared(tmp_path, entry | {"replay": [parted]})
    assert "beyond its limit: replay at 1 spp: diverged; replay at 1 spp: RMSE" in read(
        tmp_path
    )
    page = read(tmp_path, "scene_one.html")
    for shown in (
        '✗ replay at 1 spp: diverged</th><td class="num outside">9</td>',
        '✗ replay at 1 spp: RMSE</th><td class="num outside">0.0002</td>',
        "BSDF pdf, bounce 0 of sample 2",
        '<td class="num">0.60597</td><td class="num">0.30298</td>',
    ):
        assert shown in page


def test_the_page_of_a_scene_says_all_that_was_measured(tmp_path):
    compared(tmp_path, scene("sound", "pass", reference_note="film in float32"))
    text = Outline(read(tmp_path, "scene_sound.html")).text
    for wanted in (
        "Title of sound", "What it shows.", "16 samples per pixel",
        "2 more metrics, shown and not judged", "1 of 1 channels agree",
        "modelled: triangles", "float32 instead of float16", "Example CPU",
        "mitsuba 3.9.1", "0123abc", "4 times as fast to the same RMSE",
        "python -m renderer scenes/sound/scene.xml", "film in float32",
    ):  # fmt: skip
        assert wanted in text, wanted


def test_a_scene_without_noise_has_no_floor_and_says_why_it_has_no_chart(tmp_path):
    still = scene("still", "pass", deterministic=True, ladder=None)
    still["metrics"]["rmse"]["floor"] = None
    compared(tmp_path, still)
    page = read(tmp_path, "scene_still.html")
    assert "one sample is the exact answer" in page and "data-figure" not in page
    assert ", no noise, limit" in read(tmp_path)


def test_nan_pixels_are_said_aloud_and_drawn(tmp_path):
    source = write_results(tmp_path / "harness", [scene("holes", "fail")])
    path = tmp_path / "harness/holes/ours.npy"
    pixels = np.load(path)
    pixels[:2], pixels[2, 0, 0] = np.nan, np.inf
    entry = scene("holes", "fail", finite={"ours_nan": 6, "ours_inf": 1})
    content = json.loads(source.read_text()) | {"scenes": [entry]}
    bench = Bench("scenes", folder=tmp_path, options={"from": str(source)})
    source.write_text(json.dumps(content))
    np.save(path, pixels)
    with session(["holes"], bench) as take:
        rows = list(
            STUDY.measure(
                "holes",
                Bench("scenes", folder=tmp_path, options=bench.options, session=take),
            )
        )
    assert sum(row.quantity == "picture" for row in rows) == 6


def test_hostile_strings_stay_text(tmp_path, monkeypatch):
    """Markup in any string of the file is shown, not run: no tag more than without it."""
    # else one of the two pages may say that the machine was busy
    monkeypatch.setattr("reports.bench.runner.BusyClock.others", lambda clock: 0.0)
    texts = ("title", "shows", "path", "integrator", "method", "explain", "reference_note")
    plain, hostile = tmp_path / "plain", tmp_path / "hostile"
    for folder, text in ((plain, "harmless"), (hostile, HOSTILE)):
        entry = scene("one", "fail") | dict.fromkeys(texts, text)
        entry["reasons"] = entry["notes"] = entry["cautions"] = [text]
        entry["settings"], entry["commands"] = {text: text}, {text: text}
        compared(folder, entry)
    for name in ("index.html", "scene_one.html"):
        one, other = Outline(read(plain, name)), Outline(read(hostile, name))
        assert one.tags == other.tags and not other.handlers
        assert one.addresses == other.addresses


def test_pages_name_no_address_but_files_of_their_folder(tmp_path):
    compared(tmp_path, scene("sound", "pass"), scene("shifted", "fail"))
    for name in ("index.html", "scene_sound.html"):
        found = [a.partition("#")[0] for a in Outline(read(tmp_path, name)).addresses]
        local = {a for a in found if a and not a.startswith("data:")}
        written = {"pages.js", "plotly.js"}  # by the command
        assert all((tmp_path / a).is_file() for a in local - written)
        assert "default-src 'none'" in read(tmp_path, name)


def test_a_pass_that_its_own_numbers_contradict_is_a_failure(tmp_path):
    """An error of the harness must not turn a page green."""
    failed = scene("failed", "pass")
    failed["metrics"]["rmse"]["passed"] = False
    nan = scene("nan", "pass", finite={"ours_nan": 1})
    nothing = scene("nothing", "pass", aovs=[])
    for metric in nothing["metrics"].values():
        metric["passed"] = None
    beyond = scene("beyond", "pass", replay=[replay(16, 40, passed=True)])
    sizes = scene("sizes", "pass", replay=[replay(16, rmse=None, passed=True)])
    path = write_results(tmp_path, [failed, nan, nothing, beyond, sizes])
    assert {scene.verdict for scene in read_results(path).scenes} == {"fail"}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"scenes": []}, "holds no scene"),
        ({"scenes": [scene("a", "pass")] * 2}, "scene a is there twice"),
        ({"schema": 2}, r"`\$.schema`|schema"),
        ({"scenes": [scene("a", "pass", width="wide")]}, r"Expected `int`.*width"),
        ({"scenes": [scene("a", "splendid")]}, r"Invalid enum value.*verdict"),
        ({"scenes": [scene("a", "pass", replay=[replay(1, 500)])]}, "500 of 192 pixels"),
        ({"scenes": [scene("a", "pass", replay=[replay(-1)])]}, r"spp: expected 0"),
    ],
)  # fmt: skip
def test_a_file_that_cannot_be_used_is_one_line(tmp_path, change, message):
    path = write_results(tmp_path, [scene("sound", "pass")])
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(ReportError, match=message) as raised:
        read_results(path)
    assert str(path) in str(raised.value) and "\n" not in str(raised.value)


@pytest.mark.parametrize("content", ["NaN", "{", '{"schema": 1, "scenes": [Infinity]}'])
def test_what_is_no_json_is_refused(tmp_path, content):
    (tmp_path / "results.json").write_text(content)
    with pytest.raises(ReportError, match=r"malformed|truncated"):
        read_results(tmp_path / "results.json")


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda path: path.unlink(), "No such file"),
        (lambda path: path.write_bytes(b"not numpy"), "not a .npy file"),
        (lambda path: np.save(path, np.zeros((3, 4, 3), np.float32)), "do not match"),
    ],
)
def test_a_picture_that_cannot_be_used_is_a_fault_of_its_scene(tmp_path, damage, message):
    """The other scenes are measured and drawn."""
    source = write_results(tmp_path / "harness", [scene("a", "pass"), scene("b", "pass")])
    damage(tmp_path / "harness/a/ours.npy")
    bench = Bench("scenes", folder=tmp_path, options={"from": str(source)})
    with session(["a", "b"], bench) as take:
        one = Bench("scenes", folder=tmp_path, options=bench.options, session=take)
        with pytest.raises(ReportError, match=message):
            list(STUDY.measure("a", one))
        assert list(STUDY.measure("b", one))
