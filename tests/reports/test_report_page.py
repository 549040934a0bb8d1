"""The page that `python -m reports` draws, from hand-made results."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import report_samples
from report_samples import scene, stopped_scene, write_results

from mitsuba_ref.records.verdicts import COMPARED, VERDICTS, Verdict
from reports.commands import report as cli
from reports.errors import ReportError
from reports.look import formatting
from reports.records.results import read_results
from reports.scenes_page.page import results_page

HOSTILE = (
    """</script><script>alert(1)</script><img src=x onerror="alert('2')">{{ 7 * 7 }}"""
)


class Outline(HTMLParser):
    """Collects what the tests ask about: tags, ids, every address, all text."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.ids: list[str] = []
        self.addresses: list[str] = []
        self.handlers: list[str] = []
        self.text = ""
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        for name, value in attrs:
            if name == "id":
                self.ids.append(value or "")
            if name in ("href", "src", "action", "srcset", "poster", "data"):
                self.addresses.append(value or "")
            if name.startswith("on"):
                self.handlers.append(name)

    def handle_data(self, data: str) -> None:
        self.text += data


def draw(folder: Path, *scenes: dict) -> str:
    return results_page(read_results(write_results(folder, list(scenes))), folder)


def test_a_scene_without_noise_says_why_it_has_no_chart(tmp_path: Path) -> None:
    """A chart of error over samples is missing on purpose; for noisy scenes it is there."""
    why = "one sample is the exact answer"
    still = scene("still", "pass", deterministic=True, ladder=None)
    assert why in draw(tmp_path, still)
    assert why not in draw(tmp_path, scene("noisy", "pass"))


def test_failures_and_stops_come_before_passes(tmp_path: Path) -> None:
    """Order in the file: pass, fail, error, pass. On the page: what needs eyes first."""
    page = draw(
        tmp_path,
        scene("sound", "pass"),
        scene("shifted", "fail"),
        stopped_scene("broken"),
        scene("solid", "pass"),
    )
    links = re.findall(r'<th scope="row"><a href="#scene-(\w+)"', page)
    sections = re.findall(r'<section class="scene \w+" id="scene-(\w+)"', page)
    assert links == sections == ["shifted", "broken", "sound", "solid"]
    assert "2 of 4 scenes do not pass, 1 of them could not be compared" in page


LONG = "replay at 1 samples per pixel: " + "a sentence of seven hundred characters; " * 18


def test_a_failure_is_named_in_the_summary_and_a_table_with_its_limit(tmp_path: Path):
    """RMSE, SSIM and FLIP within their limits told nothing of why it failed."""
    replay = {
        "spp": 1, "pixels": 192, "divergent": 9, "divergent_allowed": 0, "rmse": 2e-4,
        "rmse_limit": 1e-5, "passed": False, "verdict": "fail", "sentence": LONG,
        "partings": [
            {
                "x": 7, "y": 9, "sample": 2, "place": "bounce 0", "quantity": "BSDF pdf",
                "ours": "0.60597", "reference": "0.30298", "error": 0.5, "limit": 1e-5,
                "within_rounding": False, "likely": "a value",
            }
        ],
    }  # fmt: skip
    entry = scene("one", "pass") | {"verdict": "fail", "reasons": [LONG]}
    page = draw(tmp_path, entry | {"replay": [replay]})
    summary, _, section = page.partition('<section class="scene fail"')
    named = "replay at 1 spp: diverged; replay at 1 spp: RMSE"
    assert f'<div class="small outside">{named}</div>' in summary
    for shown in (
        '✗ replay at 1 spp: diverged</th><td class="num outside">9</td>',
        '✗ replay at 1 spp: RMSE</th><td class="num outside">0.0002</td>',
        '<td class="num">1e-5</td>',
        "BSDF pdf, bounce 0 of sample 2",
        '<td class="num">0.60597</td><td class="num">0.30298</td>',
    ):
        assert shown in section
    # the sentence is there for who opens it, and nowhere else
    assert (
        page.count(LONG) == section.partition("The same in sentences")[2].count(LONG) == 1
    )


def test_what_is_not_judged_is_not_shown_as_if_it_were(tmp_path: Path) -> None:
    """In brackets in the summary, folded and without a judgement at the scene."""
    page = draw(tmp_path, scene("one", "pass"))
    assert ">(SSIM)</th>" in page and ">(FLIP)</th>" in page
    judged, _, folded = page.partition("2 more, shown and not judged</summary>")
    assert "✓ within" in judged and '<th scope="row">SSIM</th>' not in judged
    table = folded.partition("</table>")[0]
    assert '<th scope="row">SSIM</th>' in table and "Tolerance" not in table


@pytest.mark.parametrize("verdict", VERDICTS)
def test_every_verdict_has_its_place_on_the_page(tmp_path: Path, verdict: Verdict) -> None:
    """Stopped scenes come without pictures; "error" is what older versions wrote."""
    compared = verdict in COMPARED
    entry = scene("one", verdict) if compared else stopped_scene("one")
    page = draw(tmp_path, scene("sound", "pass"), entry | {"verdict": verdict})
    text = " ".join(Outline(page).text.split())
    assert formatting.VERDICT_SIGNS[verdict] in text
    assert ("1 of them could not be compared" in text) != compared
    assert all(reason in text for reason in entry["reasons"])
    if verdict != "error":
        assert verdict in text.partition("Other verdicts")[2] or compared


def test_pictures_of_two_sizes_leave_a_page_with_the_sentence(tmp_path: Path) -> None:
    """There is no difference to draw, but the other scenes and the reason must be there."""
    reasons = ["our picture has shape (3, 4, 3), Mitsuba's has (12, 16, 3)"]
    path = write_results(tmp_path, [scene("one", "size-mismatch", reasons=reasons)])
    np.save(tmp_path / "one/ours.npy", np.zeros((3, 4, 3), dtype=np.float32))
    text = Outline(results_page(read_results(path), tmp_path)).text
    assert reasons[0] in text
    assert "they are not of one size" in text


def test_every_row_links_to_a_section_that_exists(tmp_path: Path) -> None:
    """Names that differ only in what an anchor drops still get anchors of their own."""
    outline = Outline(draw(tmp_path, scene("a b", "pass"), scene("a-b", "pass")))
    anchors = [address[1:] for address in outline.addresses if address.startswith("#")]
    assert {"scene-a-b", "scene-a-b-2"} <= set(anchors)
    assert set(anchors) <= set(outline.ids)
    assert len(outline.ids) == len(set(outline.ids))


def test_hostile_strings_stay_text(tmp_path: Path) -> None:
    """Markup in any string of the file is shown, not run: no tag more than without it."""
    texts = ("name", "title", "shows", "path", "integrator", "method", "explain")
    hostile = scene("x", "fail") | dict.fromkeys(texts, HOSTILE)
    hostile |= {
        "reasons": [HOSTILE],
        "reference_note": HOSTILE,
        "settings": {HOSTILE: HOSTILE},
        "commands": {HOSTILE: HOSTILE},
        "metrics": {HOSTILE: report_samples.metric(1.0, 0.5, False) | {"meaning": HOSTILE}},
    }
    hostile["aovs"][0] |= {"name": HOSTILE, "meaning": HOSTILE}
    hostile["ladder"]["note"] = HOSTILE
    for point in hostile["ladder"]["points"]:
        point["renderer"] = HOSTILE
    tame = json.loads(json.dumps(hostile).replace(json.dumps(HOSTILE)[1:-1], "tame"))

    shown = Outline(draw(tmp_path / "hostile", hostile))
    expected = Outline(draw(tmp_path / "tame", tame))
    assert shown.tags == expected.tags
    assert shown.handlers == []
    assert HOSTILE in shown.text
    assert shown.tags.count("script") == 3  # the slider, plotly, and what draws with it


def test_page_needs_no_network(tmp_path: Path) -> None:
    """Every address is inside the page, and the page forbids the browser any other."""
    page = draw(tmp_path, scene("sound", "pass"), scene("shifted", "fail"))
    outline = Outline(page)
    assert outline.addresses
    assert all(address.startswith(("#", "data:")) for address in outline.addresses)
    assert not re.search(r"url\(|@import|https?:|fetch\(|XMLHttpRequest|WebSocket", page)
    assert "default-src 'none'" in page


def test_pass_that_its_own_numbers_contradict_is_a_failure(tmp_path: Path) -> None:
    """A harness bug must not turn the page green: failed metric, NaN, nothing compared."""
    failed = scene("failed", "pass")
    failed["metrics"]["rmse"]["passed"] = False
    holes = scene("holes", "pass", finite={"ours_nan": 3})
    idle = scene("idle", "pass", metrics={}, aovs=[])
    results = read_results(write_results(tmp_path, [failed, holes, idle]))
    assert [entry.verdict for entry in results.scenes] == ["fail"] * 3
    assert "rmse failed" in results.scenes[0].reasons[0]
    assert "not every value is finite" in results.scenes[1].reasons[0]
    assert "no comparison in it passed" in results.scenes[2].reasons[0]


def test_nan_pixels_are_said_aloud_and_drawn(tmp_path: Path) -> None:
    """A picture with NaN and Inf is drawn without a warning, and the counts are named."""
    entry = scene("holes", "fail", finite={"ours_nan": 6, "ours_inf": 1})
    path = write_results(tmp_path, [entry])
    pixels = np.load(tmp_path / "holes/ours.npy")
    pixels[2, 3:5] = np.nan
    pixels[4, 4, 1] = np.inf
    np.save(tmp_path / "holes/ours.npy", pixels)
    page = results_page(read_results(path), tmp_path)
    assert "Not every value is finite: ours 6 NaN and 1 Inf" in page
    assert "Every value is finite" not in page


@pytest.mark.parametrize("constant", ["NaN", "Infinity", "-Infinity"])
def test_nan_in_the_json_is_refused(tmp_path: Path, constant: str) -> None:
    """NaN compares unequal to everything, so one in the numbers could hide a failure."""
    path = write_results(tmp_path, [scene("sound", "pass")])
    path.write_text(path.read_text().replace("0.021", constant))
    with pytest.raises(ReportError, match=f"not JSON: .*found {constant}"):
        read_results(path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"schema": 2}, "schema 2; this version reads schema 1"),
        ({"scenes": []}, "holds no scene"),
        ({"scenes": {}}, "scenes: expected `array`, found {}"),
        ({"scenes": [7]}, r"scenes\[0\]: expected `object`, found 7"),
        (
            {"scenes": [{"name": "a"}]},
            r"scenes\[0\]: object missing required field `verdict`, found {",
        ),
        ({"scenes": [{"verdict": "good"}]}, "verdict: invalid enum value 'good'"),
        (
            {"scenes": [{"name": "a", "verdict": "fail", "spp": True}]},
            r"scenes\[0\].spp: expected `int`, found true",
        ),
        (
            {"scenes": [{"name": "a", "verdict": "error"}] * 2},
            "scene a is there twice",
        ),
    ],
)
def test_malformed_results_are_one_clear_line(
    tmp_path: Path, change: dict, message: str
) -> None:
    path = write_results(tmp_path, [scene("sound", "pass")])
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(ReportError, match=message) as caught:
        read_results(path)
    assert "\n" not in str(caught.value)


def test_missing_picture_is_an_error_and_leaves_the_old_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A missing picture is no pass, and a whole page is not replaced by half of one."""
    path = write_results(tmp_path, [scene("sound", "pass")])
    (tmp_path / "sound/reference.npy").unlink()
    out = tmp_path / "out"
    out.mkdir()
    (out / "index.html").write_text("the old page")
    assert cli.main(["--from", str(path), "--out", str(out)]) == 2
    assert (out / "index.html").read_text() == "the old page"
    assert [entry.name for entry in out.iterdir()] == ["index.html"]
    error = capsys.readouterr().err
    assert "reference.npy: image cannot be read" in error
    assert error.count("\n") == 1


def test_compared_scene_without_a_picture_entry_is_an_error(tmp_path: Path) -> None:
    entry = scene("sound", "pass")
    del entry["images"]["ours"]
    with pytest.raises(ReportError, match="scene sound: no ours picture"):
        draw(tmp_path, entry)


@pytest.mark.parametrize(
    "content", [b"", b"not numpy", b"\x93NUMPY\x01\x00"], ids=["empty", "text", "cut"]
)
def test_damaged_picture_is_an_error(tmp_path: Path, content: bytes) -> None:
    path = write_results(tmp_path, [scene("sound", "pass")])
    (tmp_path / "sound/ours.npy").write_bytes(content)
    with pytest.raises(ReportError, match=r"ours\.npy: image cannot be read"):
        results_page(read_results(path), tmp_path)


def test_pictures_of_different_sizes_are_an_error(tmp_path: Path) -> None:
    path = write_results(tmp_path, [scene("sound", "pass")])
    np.save(tmp_path / "sound/ours.npy", np.zeros((3, 4, 3), dtype=np.float32))
    with pytest.raises(ReportError, match="do not match"):
        results_page(read_results(path), tmp_path)


def test_exit_status_and_the_place_of_the_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """That of the verdict; the page is written and named either way."""
    for verdict, status in (("pass", 0), ("fail", 1), ("not-finite", 3)):
        out = tmp_path / verdict / "out"
        path = write_results(tmp_path / verdict, [scene("one", verdict)])
        assert cli.main(["--from", str(path), "--out", str(out)]) == status
        assert str(out / "index.html") in capsys.readouterr().out
        assert "Title of one" in (out / "index.html").read_text(encoding="utf-8")


def test_deterministic_scene_shows_no_noise_floor(tmp_path: Path) -> None:
    entry = scene("appel", "pass", deterministic=True, ladder=None)
    entry["metrics"]["rmse"]["floor"] = None
    page = draw(tmp_path, entry)
    assert "no noise</span>" in page
    assert "<svg" not in page


def test_method_does_not_repeat_the_integrator(tmp_path: Path) -> None:
    """The renderer's sentence begins with the name that the page shows already."""
    entry = scene("sound", "pass", method="path, as asked for; 16 per pixel")
    text = Outline(draw(tmp_path, entry)).text
    assert "path, as asked for; 16 per pixel" in text  # in the section
    assert text.count("path, as asked for") == 1
    assert "path, path" not in text


def test_page_explains_its_numbers_and_names_its_origin(tmp_path: Path) -> None:
    """Machine, versions, commit, command, settings and every term have their place."""
    text = Outline(draw(tmp_path, scene("sound", "pass"))).text
    for wanted in (
        "RMSE (root mean square error)",
        "Noise floor",
        "SSIM (structural similarity)",
        "FLIP",
        "Example CPU",
        "mitsuba 3.9.1",
        "0123abc",
        "python -m reports",
        "float32 instead of float16",
        "modelled: triangles",
        "sRGB curve, exposure",
        "takes 4 times as long as lightproof (median of 3 sample counts, 4 to 4)",
    ):
        assert wanted in text
