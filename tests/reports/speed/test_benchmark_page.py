"""The benchmark's page: ratios of pairs, targets, and a record that is checked."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from report_samples import benchmark, scene, write_results
from rich.console import Console

from reports.commands import benchmark as command
from reports.errors import ReportError
from reports.records.json_file import write_json
from reports.speed.compile_times import CompileTimes, SceneTime, read_compile_times
from reports.speed.page import benchmark_page
from reports.speed.record import Benchmark, read_benchmark
from reports.speed.section import build_benchmark_section
from reports.speed.table import print_benchmark


def record(folder: Path, **changes: object) -> Benchmark:
    path = folder / "benchmark.json"
    path.write_text(json.dumps(benchmark(**changes)), encoding="utf-8")
    return read_benchmark(path)


def test_ratio_is_formed_within_each_round(tmp_path: Path) -> None:
    """Ours .5 .4 .5, theirs 4 4 3.5: ratios 8, 10, 7, so 8 (7 to 10).

    The ratio of the medians would be 8, too; of the fastest times 8.75.
    """
    row = build_benchmark_section(record(tmp_path)).rows[1]
    assert row.ratio is not None
    assert (row.ratio.median, row.ratio.low, row.ratio.high) == pytest.approx((8, 7, 10))


def test_paths_and_rays_per_second(tmp_path: Path) -> None:
    """100 x 100 pixels x 100 samples in 0.5 s are 2 million paths/s, 16 million rays/s."""
    ours = build_benchmark_section(record(tmp_path)).rows[0]
    assert ours.million_paths_per_second == pytest.approx(2.0)
    assert ours.million_rays_per_second == pytest.approx(16.0)
    uncounted = build_benchmark_section(record(tmp_path, rays_per_path=None)).rows[0]
    assert uncounted.million_rays_per_second is None


def test_targets_are_judged_by_medians(tmp_path: Path) -> None:
    """Ratio 8 of 6 wanted and warm 1.45 s of 2 are met, cold 31 s of 30 is not."""
    targets = build_benchmark_section(record(tmp_path)).targets
    assert [target.met for target in targets] == [True, True, False]


def test_target_that_was_not_measured_is_not_met(tmp_path: Path) -> None:
    starts = {"warm": [], "cold": [], "command": ""}
    targets = build_benchmark_section(record(tmp_path, starts=starts)).targets
    assert [target.met for target in targets] == [True, None, None]
    assert targets[1].measured == "not measured"


def test_page_names_circumstances_and_what_was_not_available(tmp_path: Path) -> None:
    page = benchmark_page(record(tmp_path))
    for wanted in (
        "not available: no libLLVM",
        "Example CPU",
        "0123abc",
        "python -m reports.benchmark",
        "standard errors",
        "8 times as fast as mitsuba scalar_rgb",
    ):
        assert wanted in page
    addresses = re.findall(r'(?:href|src)="([^"]*)"', page)
    assert all(address in ("data:,", "index.html", "#content") for address in addresses)


def test_page_is_drawn_again_from_json_and_linked_from_the_index(tmp_path: Path) -> None:
    """`--from` needs no renderer; an index in the same folder gets a link to the page."""
    source = tmp_path / "old.json"
    source.write_text(json.dumps(benchmark()))
    out = tmp_path / "out"
    write_results(out / "data", [scene("sound", "pass")])
    assert command.main(["--from", str(source), "--out", str(out)]) == 0
    assert "Speed, measured in turn" in (out / "benchmark.html").read_text()
    index = (out / "index.html").read_text()
    assert '<a href="benchmark.html">' in index
    # An old benchmark beside new pictures must be told from a new one.
    speed = index.partition('id="speed"')[2].partition("</section>")[0]
    assert "on 2026-01-02T03:04:05Z at commit <code>0123abc</code>" in speed


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"schema": 9}, "schema 9; this version reads schema 1"),
        ({"renderers": []}, r"renderers: expected .* length >= 1, found \[\]"),
        ({"renderers": [{"name": "a"}]}, "the first one needs at least one time"),
        (
            {"renderers": [{"name": "a", "seconds": ["1"]}]},
            r'renderers\[0\].seconds\[0\]: expected `float`, found "1"',
        ),
        ({"width": "wide"}, 'width: expected `int`, found "wide"'),
    ],
)
def test_malformed_records_are_one_clear_line(
    tmp_path: Path, changes: dict, message: str
) -> None:
    with pytest.raises(ReportError, match=message):
        record(tmp_path, **changes)


def test_damaged_record_leaves_the_old_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "data/benchmark.json").write_text("the old record")
    broken = tmp_path / "broken.json"
    broken.write_text("{")
    assert command.main(["--from", str(broken), "--out", str(tmp_path)]) == 2
    assert (tmp_path / "data/benchmark.json").read_text() == "the old record"
    assert "broken.json:1: not JSON" in capsys.readouterr().err


def compiled() -> CompileTimes:
    scenes = (SceneTime("metals", 9.25, 28.3), SceneTime("mine", 0.5))
    return CompileTimes(command="make bench", commit="0123abc", scenes=scenes)


def test_compile_times_stand_on_the_page_and_in_the_record(tmp_path: Path) -> None:
    """Written, read again, drawn: each scene beside its former time, and the sum."""
    path = tmp_path / "compile_times.json"
    write_json(path, compiled(), 1)
    assert read_compile_times(path) == compiled()
    page = benchmark_page(record(tmp_path), read_compile_times(path))
    numbers = re.findall(r'<th scope="row">(\w+)</th><td class="num">([^<]+)</td>', page)
    assert [("metals", "9.25"), ("mine", "0.5"), ("all", "9.75")] == numbers[-3:]
    assert "What compiles" not in benchmark_page(record(tmp_path))


def test_compile_alone_times_no_renderer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """`--compile` prints its table and keeps its record; an older benchmark is redrawn."""

    def measured(words: str, progress: Callable[[str], None]) -> CompileTimes:
        progress("compiling metals")
        return compiled()

    monkeypatch.setattr(command, "measure_compile_times", measured)
    monkeypatch.setattr(command, "measure", lambda *_: pytest.fail("timed"))
    assert command.main(["--compile", "--out", str(tmp_path)]) == 0
    shown = capsys.readouterr()
    assert "compiling metals" in shown.err
    assert re.search(r"metals +│ +9.25 │ +28.3", shown.out)
    assert "commit 0123abc" in shown.out
    assert not (tmp_path / "benchmark.html").exists()
    (tmp_path / "data/benchmark.json").write_text(json.dumps(benchmark()))
    assert command.main(["--compile", "--out", str(tmp_path)]) == 0
    assert "What compiles" in (tmp_path / "benchmark.html").read_text()


def test_table_has_ratios_seconds_versions_and_machine(tmp_path: Path) -> None:
    """The numbers of the page, as text; a renderer that is missing says why."""
    console = Console(file=io.StringIO(), width=120)
    print_benchmark(record(tmp_path), console)
    text = console.file.getvalue()
    for wanted in ("lightproof ", "8 │ 7 to 10", "0.4 s to 0.5 s", "Mrays/s"):
        assert wanted in text
    assert "mitsuba llvm_ad_rgb: not available: no libLLVM" in text
    assert "…" not in text  # nothing is cut
    for wanted in ("machine: cpu Example CPU", "versions: python 3.11", "NOT reached"):
        assert wanted in text
