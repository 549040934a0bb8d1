"""The studies of speed: what is compared before it is timed, and what the rows say."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reports import command
from reports.bench.rows import Row, Table
from reports.bench.store import Store
from reports.bench.study import Bench, find_study
from reports.studies import benchmark, calibration, cluster, options
from reports.studies.benchmark import Picture, compared
from reports.trials import contenders
from reports.trials.cluster_simulation import Costs
from reports.trials.contenders import OURS, REFERENCE, Contender, Render

KEPT = Store(Path("none"))


def rows_of(study: Any, case: str, **options: str) -> Table:
    return Table(tuple(study.STUDY.measure(case, Bench("s", quick=True, options=options))))


# -------------------------------------------------------------------------- pictures


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """One small picture; Mitsuba's llvm variant is not on every machine."""
    monkeypatch.setattr(
        benchmark, "PICTURES", {"small": Picture("cornell-box", 24, 18, 16)}
    )
    monkeypatch.setattr(contenders, "PEERS", {REFERENCE: "scalar_rgb"})


def darker(contender: Contender) -> Contender:
    def half(seed: int, spp: int) -> Render:
        made = contender(seed, spp)
        red, green, blue = made.mean
        return Render(made.seconds, (red / 2, green / 2, blue / 2))

    return half


def test_a_picture_is_timed_after_its_mean_was_compared(small: None) -> None:
    told: list[str] = []
    bench = Bench("benchmark", show=told.append, options={"rounds": "3"})
    table = Table(tuple(benchmark.measure("small", bench)))
    comparing = told.index(f"comparing image means with {REFERENCE}")
    assert comparing < told.index(f"round 1 of 3: {OURS}")
    times = table.where(quantity="time of a picture", unit="s")
    assert times.distinct("contender") == [OURS, REFERENCE]
    assert all(row.value > 0.0 and row.interval for row in times)
    ratio = table.value(contender=REFERENCE, quantity=benchmark.TIMES["picture"])
    assert ratio > 0.0 and f"{REFERENCE} takes {ratio:.3g} times" in benchmark.verdict(
        table
    )
    assert table.value(quantity="size") == "24 x 18, 16 samples"
    assert len(table.where(quantity="million rays per second")) == 2


def test_a_wrong_picture_is_not_timed(small: None, monkeypatch: pytest.MonkeyPatch) -> None:
    right = contenders.mean_of  # ours alone is rendered into pictures
    monkeypatch.setattr(contenders, "mean_of", lambda renders: darker(right(renders)))
    with pytest.raises(ValueError, match=r"standard errors apart .* nothing was timed"):
        rows_of(benchmark, "small")


def test_another_variant_that_is_wrong_or_absent_is_left_out(
    small: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As Mitsuba's llvm variant is, 0.3 % off, where there are instances."""
    load = benchmark.load_all

    def loaded(*arguments: Any, **ways: Any) -> Any:
        found, _ = load(*arguments, **ways)
        return found | {"dark": darker(found[REFERENCE])}, {"gone": "no LLVM"}

    monkeypatch.setattr(benchmark, "load_all", loaded)
    table = rows_of(benchmark, "small", rounds="1")
    gone, dark = table.sentences("left out")
    assert gone == "small, gone: no LLVM" and "standard errors apart" in dark
    times = table.where(quantity="time of a picture")
    assert times.distinct("contender") == [OURS, REFERENCE]


def test_ratios_are_formed_round_by_round() -> None:
    """2, 8 and 4 times as long: the geometric mean is 4."""
    times = {"mine": [1.0, 1.0, 2.0], "theirs": [2.0, 8.0, 8.0]}
    table = Table(tuple(compared("a", "ray", times, "mine", "ns")))
    (ratio,) = table.where(unit="times")
    assert ratio.contender == "theirs" and ratio.value == pytest.approx(4.0)
    assert ratio.interval[0] < 4.0 < ratio.interval[1]
    assert [row.value for row in table.where(unit="ns")] == [1.0, 8.0]


def test_verdict_has_the_geometric_mean_and_the_range() -> None:
    rows = [
        Row(case=str(v), contender="x", quantity=benchmark.TIMES["picture"], value=v)
        for v in (2.0, 8.0)
    ]
    said = "For a picture x takes 4 times as long as lightproof (2 to 8)."
    assert benchmark.verdict(Table(tuple(rows))) == said
    assert benchmark.verdict(Table()) == ""


def test_rays_are_timed_by_one_thread_and_by_all() -> None:
    """Peers that a machine lacks are named; embreex is one that all tests have."""
    table = rows_of(benchmark, "teapot, diffuse rays", rounds="2", threads="2")
    times = table.where(quantity="time of a ray", unit="ns").distinct("contender")
    assert times[0] == f"{OURS} (1 thread)" and f"{OURS} (2 threads)" in times
    named = {*times, *table.where(quantity="left out").distinct("contender")}
    assert any(name.startswith("embreex") for name in named)
    assert any(name.startswith("mitsuba llvm_ad_rgb") for name in named)
    assert 40 < table.value(quantity="tests of boxes and triangles a ray") < 60


def test_a_start_is_timed_with_and_without_compiled_kernels(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The first warm one fills the cache and does not count."""
    seconds = iter([9.0, 1.0, 2.0, 4.0, 30.0])
    caches = []

    def start(scene: Path, size: object, cache: Path | None = None) -> float:
        caches.append(cache)
        return next(seconds)

    monkeypatch.setattr(benchmark, "start_seconds", start)
    bench = Bench("benchmark", options={"rounds": "3"})
    table = Table(tuple(benchmark.measure(benchmark.START, bench)))
    assert [row.value for row in table] == [2.0, 30.0]
    assert caches[:4] == [None] * 4 and caches[4] is not None


# ---------------------------------------------------------------- what a render claims


def test_claims_are_compared_with_a_finer_picture() -> None:
    table = rows_of(calibration, "cornell-box", seeds="2", error="20")
    claimed, true = (
        table.value(quantity=calibration.ERROR, contender=name)
        for name in ("claimed", "true")
    )
    assert 0.0 < claimed <= 20.0 and 0.0 < true < 40.0
    (row,) = rows_of(calibration, "grey-furnace", seeds="2", error="20")
    assert (row.quantity, row.value[:10]) == ("left out", "16 samples")


def test_right_is_within_a_fifth() -> None:
    """0.1 is 19 % from 0.084, 17 % from 0.121, half of 0.2."""
    rows = calibration.claims("x", [0.1] * 4, [0.1, 0.084, 0.121, 0.2], [16, 20, 8, 9], 1)
    table = Table(tuple(rows))
    assert table.value(quantity=calibration.RIGHT) == 75.0
    assert "75 % of the claimed errors of 1 scenes" in calibration.verdict(table)
    assert calibration.verdict(KEPT.read("calibration")).startswith("All claims of 14")


def test_kept_claims_are_those_of_the_old_table() -> None:
    """Its rows of three scenes stand in docs/statistics.md."""
    table = KEPT.read("calibration")
    assert len(table.distinct("case")) == 14 and table.newest.commit == "741008c32dcd"
    for case, claimed, least, most, unsure, samples in (
        ("analytic-shapes", 9.78, 8.95, 10.39, 0, (38, 44)),
        ("caustic", 9.64, 9.25, 11.96, 16, (400, 624)),
        ("leaves", 4.30, 3.76, 10.71, 14, (32, 272)),
    ):
        part = table.where(case=case)
        middle = part.value(quantity=calibration.ERROR, contender="claimed")
        assert middle == pytest.approx(claimed, abs=0.0051)
        ends = [row.value for row in part.where(quantity="true errors")]
        assert ends == pytest.approx([least, most], abs=0.0051)
        assert part.value(quantity=calibration.RIGHT) == 100.0
        unsure_row = part.value(quantity="pictures that call their claim unsure")
        assert unsure_row == f"{unsure} of 16"
        spp = part.where(quantity="samples per pixel")
        assert tuple(row.value for row in spp) == samples


def test_kept_compile_times_are_those_of_the_old_record() -> None:
    table = KEPT.read("compile-times")
    assert table.value(contender="metals", quantity="processor time") == 4.643858976999999
    said = "The kernels of 9 scenes compile in 26.2 s of one core, instead of 119 s"
    assert find_study("compile-times").verdict(table).startswith(said)


# --------------------------------------------------------------------------- clusters


def test_clusters_are_simulated_with_the_costs_of_this_machine(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The costs of docs/cluster.md give its table: 1,162 s and 236 s, 93 % and 46 %."""
    costs = Costs(4.3e-3, 12e-9, 2.1, 1.4, 0.012, 3.2e6)
    monkeypatch.setattr(cluster, "_costs", lambda side: costs)
    table = rows_of(cluster, cluster.SIMULATED)
    large = table.where(contender="4K, 4096 dear spp, 1 GB of scene")
    seconds = [row.value for row in large.curve(quantity="time")]
    assert seconds == pytest.approx([10_860, 1_162, 236], rel=0.05)
    said = "Of the time of a large picture, tracing is "
    assert cluster.verdict(table) == said + "93 % with 100 workers, 46 % with 1000 workers."


@pytest.mark.slow
def test_threads_and_workers_render_the_same_picture(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(cluster, "COUNTS", (1,))
    table = rows_of(cluster, cluster.HERE, size="48", spp="8", rounds="2")
    assert table.value(contender="1 worker", quantity=cluster.RATIO) > 0.0
    costs = table.where(quantity="cost")
    assert len(costs) == 6 and all(row.value >= 0.0 for row in costs)
    assert table.value(contender="an empty task, there and back") > 0.0


@pytest.mark.slow
def test_a_killed_render_is_resumed_to_the_same_file(tmp_path, capsys):
    words = ["resilience", "--set", "spp=256", "--out", str(tmp_path)]
    assert command.main(words) == 0
    assert "gives the same file" in capsys.readouterr().out


# ----------------------------------------------------------------------------- options


def test_errors_of_options_are_their_variances() -> None:
    """Noise of 0.1 and 0.2 around 2 has relative squares of 0.0025 and 0.01."""
    rng = np.random.default_rng(7)
    pictures = {
        name: [2.0 + noise * rng.standard_normal((50, 50, 3)) for _ in range(3)]
        for name, noise in {options.DEFAULT: 0.1, "noisy": 0.2}.items()
    }
    errors = options.squared_errors(pictures)
    # of 22,500 squares a standard error of 1 %; the largest thousandth, left out, has 1 %
    assert np.mean(errors[options.DEFAULT]) == pytest.approx(0.0025, rel=0.05)
    assert np.mean(errors["noisy"]) == pytest.approx(0.01, rel=0.05)
    seconds = {options.DEFAULT: [2.0, 2.0, 2.0], "noisy": [1.0, 1.0, 1.0]}
    variances = [options.median_variance(each) for each in pictures.values()]
    assert variances[1] / variances[0] == pytest.approx(4.0, rel=0.1)
    value, (low, high) = options.speed(errors, seconds, "noisy")
    assert value == pytest.approx(0.5, rel=0.1) and low < value < high


def test_a_scene_without_noise_is_left_out() -> None:
    table = rows_of(options, "many-lights", spp="1", seeds="2")
    assert [row.value for row in table.where(quantity="left out")] == ["hardly any noise"]


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("seed=1", "study calibration has no option 'seed'"),
        ("seeds=x", "--set seeds=x: expected a whole number, 2 or more"),
    ],
)
def test_wrong_options_are_one_line_and_no_rows(option, message, tmp_path, capsys):
    words = ["calibration", "--case", "metals", "--set", option, "--out", str(tmp_path)]
    assert command.main(words) == 2
    assert message in capsys.readouterr().err
    assert not Store(tmp_path / "data", tmp_path).everything("calibration")
