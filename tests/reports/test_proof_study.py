"""What replay, tests, mutations, false alarms and the register say, as rows and pages."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from report_samples import compared, proven, replay, rung, scene

from mitsuba_ref.expected_failures.register import ExpectedFailure
from mitsuba_ref.false_alarms.alarm_counts import WHOLE, FalseAlarms, RungAlarms
from mitsuba_ref.false_alarms.binomial import rate
from mitsuba_ref.mutations.matrix import Row as MatrixRow
from mitsuba_ref.mutations.rungs import Rung
from mitsuba_ref.records.request import FEWEST_SEEDS
from reports.bench.rows import Run, Table
from reports.bench.store import MEASURED, Store
from reports.bench.study import Bench
from reports.look.shared_files import write_shared_files
from reports.pages.table_page import table_page
from reports.studies import false_alarms, mutations, proof, register


def page(folder, *scenes):
    compared(folder, *scenes, study="proof")
    return (folder / "proof.html").read_text(encoding="utf-8")


def test_the_page_begins_with_numbers_that_can_be_used(tmp_path):
    """Two scenes: 4 replays of 192 pixels with 1 divergent one; biases 2 % and 8 %."""
    other = proven(
        "other", replay=[replay(1), replay(16, 1, traced=1)], rungs=[rung("mean", 0.08)]
    )
    # without noise its bias does not count with theirs, and it is not replayed
    still = proven("still", deterministic=True, replay=[], rungs=[rung("mean", 1e-4)])
    shown = page(tmp_path, proven("box"), other, still)
    top = shown.partition('<section aria-labelledby="scenes">')[0]
    assert "✓ 3 of 3 scenes pass" in top
    assert '<p class="big">99.86\u00a0%</p>' in top  # 767 of 768, rounded down
    assert "767 of 768 pixels get the same colour in both programs" in top
    assert "rounding explains all of the others that were traced" in top
    # of brightness; the shift of 1e-9 pixels is another kind of error
    assert '<p class="big">5\u00a0%</p>' in top and "of 8\u00a0% on the hardest" in top
    for cell in ("1 <span", "0 <span", "3 hold", "1 hold", "2.5e-7"):
        assert cell in shown


def test_the_help_says_how_many_seeds_are_the_fewest():
    assert f"{FEWEST_SEEDS} or more" in proof.STUDY.options["seeds"]


def test_what_failed_is_first_and_named(tmp_path):
    broken = rung("tiles", passed=False, statistic=9.0, sentence="Tile 3 is too bright.")
    failing = proven("shifted", "fail", rungs=[rung("mean"), broken])
    shown = page(tmp_path, proven("sound"), failing, scene("plain", "pass", ladder=None))
    assert "✗ 2 of 3 scenes pass, and 1 fault was found" in shown
    assert "✗ broke at tiles" in shown
    assert shown.index("scene_shifted.html") < shown.index("scene_sound.html")
    assert "not replayed" in shown and "not tested" in shown
    own = (tmp_path / "scene_shifted.html").read_text(encoding="utf-8")
    assert "Tile 3 is too bright." in own and "✗ broken" in own


def test_a_scene_has_its_proof_on_its_own_page_also_alone(tmp_path):
    """Only the study `proof` was run: the page has replays, tests, maps and causes."""
    page(tmp_path, proven("box", replay=[replay(1), replay(16, 1)]))
    own = (tmp_path / "scene_box.html").read_text(encoding="utf-8")
    for wanted in (
        "1 of 192", "a shadow ray passes an edge by 3e-8", "Rung mean came out well.",
        "3 tests with other random numbers", "--trace X,Y", "Evidence of a difference",
        "<circle", 'cx="3.5" cy="4.5"', "90 in the first of 2 bins, expected 96",
    ):  # fmt: skip
        assert wanted in own
    assert "Speed against accuracy" not in own


def test_replays_of_two_sizes_are_a_fault_not_a_picture(tmp_path):
    sizes = replay(1, passed=False, verdict="size-mismatch", sentence="16 x 12, 9 x 9")
    entry = proven("box", "fail", replay=[sizes])
    entry["images"].pop("replay_reference")
    table = compared(tmp_path, entry, study="proof").read("proof")
    assert table.faults == ["box: beyond its limit: RMSE; replay at 1 spp"]
    assert not table.where(contender="replay", quantity="picture")


def test_p_map_counts_the_smallest_of_three_thrice():
    p = np.array([[[0.5, 0.9, 1.0], [0.01, 0.2, 0.3], [1.0, np.nan, 1.0]]])
    found = proof.evidence_against(p)
    assert found[0, :2] == pytest.approx([0.0, -np.log(0.03)])
    assert found[0, 2] > 600.0


# ------------------------------------------------------------------------- mutations


def tried(harmful, *caught, **changes):
    rungs = [Rung(name, name in caught, "why", 32, 1.5) for name in ("AOVs", "replay")]
    fields = {"rungs": tuple(rungs), "compile_seconds": 3.0, **changes}
    return MatrixRow("m", "does", harmful, "box", **fields)


@pytest.mark.parametrize(
    ("row", "fault"),
    [
        (tried(True, "replay"), None),
        (tried(False), None),
        (tried(True), "no check sees this defect"),
        (tried(False, "AOVs"), "AOVs alarms although nothing is wrong"),
        (tried(True, "replay", broken=("AOVs",)), "AOVs also sees the unchanged renderer"),
    ],
)
def test_a_mutation_that_is_not_as_expected_is_a_fault(row, fault):
    found = [one.value for one in mutations.rows_of(row) if one.quantity == "fault"]
    assert found == ([fault] if fault else [])


def test_the_kept_mutations_have_the_numbers_of_the_old_page():
    """140 defects and 7 harmless changes; the replay was the first to see 70 of them."""
    table = Store(Path("nowhere"), MEASURED).read("mutations")
    assert mutations.verdict(table) == (
        "The checks see 140 of 140 defects that were built in on purpose, and leave 7 of 7 "
        "harmless changes alone."
    )
    first = [row.value for row in table.where(quantity="seen first by")]
    counts = {name: first.count(name) for name in ("replay", "AOVs", "unit tests")}
    assert counts == {"replay": 70, "AOVs": 34, "unit tests": 23}
    assert set(table.distinct("case")) <= set(mutations.MUTATIONS)


def test_the_table_groups_rungs_and_puts_faults_first():
    run = Run(run="r", created="2026", command="c")
    hole = dataclasses.replace(tried(True), mutation="hole")
    rows = [*mutations.rows_of(tried(True, "replay")), *mutations.rows_of(hole)]
    rows = [dataclasses.replace(row, run="r") for row in rows]
    page = table_page("mutations", mutations.STUDY, Table(tuple(rows), {"r": run}))
    assert page.index('<tr class="hole"><th scope="row">hole') < page.index(">m</th>")
    heads = page.partition("<thead>")[2].partition("</thead>")[0]
    order = [heads.index(name) for name in ("seen first by", "AOVs", "replay", "because")]
    assert order == sorted(order)


# ------------------------------------------------------- false alarms and the register


def test_alarms_beyond_the_claim_are_a_fault():
    """50 alarms in 100 where 1 % is claimed; 1 in 100 is within it."""
    for count, faults in ((1, 0), (50, 1)):
        whole = RungAlarms(WHOLE, rate(count, 100), 0.01, None, None)
        one = RungAlarms("mean", rate(0, 100), 0.001, rate(5, 100), 0.02)
        made = FalseAlarms("ours against Mitsuba", (one, whole))
        table = Table(tuple(false_alarms.rows_of("box", made)))
        assert len(table.faults) == faults
        assert f"{count} of 100 comparisons" in false_alarms.verdict(table)
        (below,) = table.where(quantity="p up to 5 %")
        assert below.value == 0.05 and below.interval[0] < 0.05 < below.interval[1]


@pytest.mark.parametrize(
    ("measured", "state"),
    [(0.5, "still disagrees"), (0.0, "agrees now"), (0.9, "another number")],
)
def test_an_entry_of_the_register_that_changes_is_a_fault(monkeypatch, measured, state):
    entry = ExpectedFailure("x", "w", lambda: measured, 0.5, (0.4, 0.6), (0.0, 0.1), "r")
    monkeypatch.setitem(register.ENTRIES, "x", entry)
    table = Table(tuple(register.measure("x", Bench("register"))))
    assert state in table.value(quantity="state")
    assert len(table.faults) == (state != "still disagrees")
    assert table.value(quantity="band") == "0.4 to 0.6"
    still = state == "still disagrees"
    assert register.verdict(table).startswith(f"{int(still)} of 1 known disagreements")


def test_shared_files_name_only_pages_that_are_there(tmp_path):
    (tmp_path / "a.html").write_text("")
    write_shared_files(tmp_path, [("a.html", "A & co"), ("b.html", "B")])
    bar = (tmp_path / "pages.js").read_text()
    assert '["a.html", "A \\u0026 co"]' in bar and "b.html" not in bar
    assert (tmp_path / "plotly.js").stat().st_size > 1e6
