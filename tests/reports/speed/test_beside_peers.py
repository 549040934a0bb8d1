"""Pictures and rays beside peers: what is measured, what is refused, record and table."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from rich.console import Console

from reports.accelerator_trials.meshes import displaced_icosphere
from reports.beside_peers import measure, pictures, rays
from reports.beside_peers.pictures import Wanted
from reports.beside_peers.record import SCHEMA, PeersRecord, RayTimes, ratio, read_peers
from reports.beside_peers.table import print_peers
from reports.commands import benchmark
from reports.errors import ReportError
from reports.records.json_file import write_json
from reports.speed import contenders
from reports.speed.record import MeanCheck, Renderer
from reports.speed.turns import MeansCompared

REFERENCE = "mitsuba scalar_rgb"
CHECK = MeanCheck(True, 8, 4, (0.0,) * 3, 4.0, (1.0,) * 3, (1.0,) * 3)


@pytest.fixture
def one_peer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Mitsuba's llvm variant is not on every machine."""
    monkeypatch.setattr(contenders, "PEERS", {REFERENCE: "scalar_rgb"})


def test_a_picture_is_timed_in_turn_after_its_mean_was_compared(one_peer: None) -> None:
    told: list[str] = []
    wanted = (Wanted("cornell-box", 16, 12, 4),)
    (one,) = pictures.time_pictures(2, 3, told.append, wanted)
    assert (one.name, one.width, one.height, one.spp) == ("cornell-box", 16, 12, 4)
    assert [each.name for each in one.renderers] == ["lightproof", REFERENCE]
    assert all(len(each.seconds) == 3 for each in one.renderers)
    assert one.check.passed and one.check.ours_mean != one.check.reference_mean
    title = "cornell-box, 16 x 12, 4 samples: "
    assert told[0] == f"{title}loading lightproof"
    assert told.index(f"{title}comparing image means with {REFERENCE}") < told.index(
        f"{title}round 1 of 3: lightproof"
    )


def test_a_wrong_picture_is_not_timed(
    one_peer: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Half as bright, say: then nobody is told how fast it was made."""
    right = contenders.ours

    def darker(*arguments, **ways):  # type: ignore[no-untyped-def]
        render = right(*arguments, **ways)

        def half(seed, spp):  # type: ignore[no-untyped-def]
            made = render(seed, spp)
            return type(made)(made.seconds, tuple(0.5 * value for value in made.mean))

        return half

    monkeypatch.setattr(contenders, "ours", darker)
    wanted = (Wanted("cornell-box", 24, 18, 16),)
    with pytest.raises(ReportError, match="standard errors apart; it was not timed"):
        pictures.time_pictures(2, 1, lambda stage: None, wanted)


def test_another_variant_that_is_wrong_is_left_out_and_named(
    one_peer: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As Mitsuba's llvm variant is, 0.3 % off, where there are instances."""
    for module in (pictures, contenders):
        monkeypatch.setattr(module, "REFERENCE", "another")
    monkeypatch.setattr(
        pictures,
        "compare_means",
        lambda first, second, seeds, spp: compared(second is right),
    )
    right = None
    peers = {"another": "scalar_rgb", "wrong": "scalar_rgb"}
    monkeypatch.setattr(contenders, "PEERS", peers)
    kept = contenders.theirs

    def theirs(peer, sampler):  # type: ignore[no-untyped-def]
        nonlocal right
        made = kept(peer, sampler)
        right = made if right is None else right
        return made

    monkeypatch.setattr(contenders, "theirs", theirs)
    wanted = (Wanted("cornell-box", 8, 6, 1),)
    (one,) = pictures.time_pictures(2, 1, lambda stage: None, wanted)
    assert [len(each.seconds) for each in one.renderers] == [1, 1, 0]
    assert "by wrong" in one.renderers[2].unavailable


def compared(passed: bool) -> MeansCompared:
    """Return a comparison that passed, or did not."""
    rgb = (1.0, 1.0, 1.0)
    return MeansCompared((0.0,) * 3, 4.0, 1.0 if passed else 0.0, rgb, rgb)


def test_rays_of_each_kind_are_counted_and_timed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Peers that a machine lacks are named; embreex is one that all tests have."""
    monkeypatch.setattr(rays, "MESHES", (lambda: displaced_icosphere(3),))
    found = rays.time_rays([1], 2, lambda stage: None, pixels=24)
    assert [one.kind for one in found] == ["camera", "shadow", "diffuse"]
    for one in found:
        assert one.triangles == 180 and one.threads == 1 and one.rays > 0
        assert next(iter(one.nanoseconds)) == "wide" and one.tests > 1
        assert {*one.nanoseconds, *one.faults} >= {"wide", "mitsuba llvm_ad_rgb"}
        assert all(len(times) == 2 for times in one.nanoseconds.values())


def record() -> PeersRecord:
    """Return a record of round numbers: ours twice and four times as fast."""
    seconds = Renderer("lightproof", (1.0, 1.0)), Renderer(REFERENCE, (2.0, 2.2))
    absent = Renderer("mitsuba llvm_ad_rgb", (), "not available: no LLVM")
    return PeersRecord(
        threads=2,
        pictures=(pictures.PictureTimes("a", 8, 6, 4, CHECK, (*seconds, absent)),),
        rays=(
            RayTimes(
                "ball",
                20,
                "shadow",
                1,
                64,
                7.5,
                {"wide": (10.0, 20.0), "embreex": (40.0, 80.0)},
                {"mitsuba llvm_ad_rgb": "not available: no LLVM"},
            ),
        ),
    )


def test_the_record_is_read_as_it_was_written_and_shown(tmp_path: Path) -> None:
    path = tmp_path / "peers.json"
    write_json(path, record(), SCHEMA)
    assert read_peers(path) == record()
    shown = io.StringIO()
    print_peers(read_peers(path), Console(file=shown, width=120))
    text = shown.getvalue()
    assert "a, 8 x 6" in text and "2.1" in text  # the median of 2 and 2.2
    assert "ball, shadow" in text and "7.5" in text and " 4 " in text
    assert text.count("no LLVM") == 1  # of pictures and of rays alike


def test_a_ratio_is_formed_round_by_round() -> None:
    assert ratio((2.0, 30.0, 4.0), (1.0, 10.0, 1.0)) == 3.0


def test_the_command_measures_these_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """No benchmark beside it, and nothing from an older file."""
    asked = []

    def measured(threads, rounds, command, show):  # type: ignore[no-untyped-def]
        asked.append((threads, rounds))
        return record()

    monkeypatch.setattr(benchmark, "measure_peers", measured)
    monkeypatch.setattr(benchmark, "measure", None)
    words = ["--peers", "--rounds", "3", "--threads", "2", "--out", str(tmp_path)]
    assert benchmark.main(words) == 0
    assert asked == [(2, 3)] and read_peers(tmp_path / "data" / "peers.json") == record()
    assert "ball, shadow" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        benchmark.main(["--peers", "--from", "benchmark.json"])
    assert "--peers measures" in capsys.readouterr().err


def test_one_thread_is_measured_beside_all(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[list[int]] = []

    def no_rays(threads, *_):  # type: ignore[no-untyped-def]
        asked.append(threads)
        return ()

    monkeypatch.setattr(measure, "time_pictures", lambda *_: ())
    monkeypatch.setattr(measure, "time_rays", no_rays)
    for threads in (2, 1):
        assert measure.measure_peers(threads, 1, "c", lambda stage: None).rays == ()
    assert asked == [[1, 2], [1]]
