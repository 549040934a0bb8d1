"""The page "proof": drawn from records alone."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import proof_samples as sample
import pytest
from report_samples import scene as rendered_scene
from report_samples import stopped_scene

from reports.proof_page.mutation_table import mutation_table
from reports.proof_page.page import proof_page
from reports.proof_page.pictures import evidence_against
from reports.proof_page.record import read_proof_record
from reports.proof_page.sentences import headlines, scene_sentence

NBSP = "\u00a0"


def drawn(folder: Path, *scenes: dict[str, Any], **files: dict[str, Any]) -> str:
    return proof_page(sample.record(folder, *scenes, **files), folder)


def sentence(folder: Path, **changes: Any) -> str:
    found = sample.record(folder, sample.proven("box", **changes)).results.scenes[0]
    return scene_sentence(found).replace(NBSP, " ")


# -------------------------------------------------------------- what was shown in words


def test_sentence_says_what_was_shown_and_what_was_not(tmp_path: Path) -> None:
    """The smallest error of brightness is the mean's 2 %, not the shift of 1e-9 pixels."""
    assert sentence(tmp_path) == (
        "With the same random numbers the two programs give the same colour (to 0.03 %) in "
        "all 192 pixels, at 1 sample and at 16 samples each; with different random numbers "
        "no test could tell their pictures apart, though an error of 2 % in brightness "
        "would have been noticed 99 times in 100, and a smaller one perhaps not; an error "
        "that both programs share cannot be seen this way."
    )


def test_divergent_pixels_are_in_the_sentence(tmp_path: Path) -> None:
    said = sentence(tmp_path, replay=[sample.replay(1), sample.replay(16, 1)])
    assert (
        "in all 192 pixels at 1 sample each and in 191 of 192 pixels at 16 samples" in said
    )


def test_rounding_beyond_the_limits_is_in_the_sentence(tmp_path: Path) -> None:
    """A pass that its traces alone support says so."""
    beyond = sample.replay(16, 40) | {"passed": True, "verdict": "pass", "traced": 16}
    said = sentence(tmp_path, replay=[beyond])
    assert "in 152 of 192 pixels (rounding explains all 16 that were traced" in said
    unexplained = sentence(tmp_path, replay=[beyond | {"unexplained": 1}])
    assert "do NOT agree" in unexplained


@pytest.mark.parametrize(
    ("changes", "wanted"),
    [
        (
            {"replay": [sample.replay(1, 40)], "verdict": "fail"},
            "two programs do NOT agree: they give the same colour (to 0.03 %) only in 152",
        ),
        (
            {"replay": [sample.replay(1, rmse=2e-5, passed=False)], "verdict": "fail"},
            "in all 192 pixels, at 1 sample each, but there they differ by MORE than "
            "rounding explains (2e-5 of the mean); with",
        ),
        (
            {"replay": [sample.replay(1, rmse=None, passed=False)], "verdict": "fail"},
            "do NOT agree: they give the same colour (to 0.03 %) only in none (192",
        ),
        (
            {"rungs": [sample.rung("tiles", passed=False)], "verdict": "fail"},
            "the ladder of tests broke at “tiles”: Rung tiles came out well",
        ),
        (
            {"replay": [], "settings": {"replay": "sampler 'sobol' has no twin"}},
            "nothing was shown (sampler 'sobol' has no twin)",
        ),
        ({"rungs": []}, "with different random numbers nothing was tested"),
        (
            {"deterministic": True},
            "Nothing is random here, and the two programs give the s",
        ),
        (
            {"verdict": "refused-by-us", "reasons": ["no hair"]},
            "Nothing was shown: Mitsuba renders the scene, we do not.",
        ),
    ],
)
def test_sentence_never_says_more_than_was_shown(
    tmp_path: Path, changes: dict[str, Any], wanted: str
) -> None:
    said = sentence(tmp_path, **changes)
    assert wanted in said
    broken = changes.get("verdict") is not None
    assert not (broken and "tiles" in said and "would have been noticed" in said)


def test_three_sentences_count_everything(tmp_path: Path) -> None:
    """Two scenes: 4 replays of 192 pixels with 1 divergent one; biases 2 % and 8 %.

    A third has no replay, and no noise, so that its bias does not count with theirs.
    """
    other = sample.proven(
        "other",
        replay=[sample.replay(1), sample.replay(16, 1, rmse=3e-6)],
        rungs=[sample.rung("mean", 0.08)],
    )
    still = sample.proven("still", deterministic=True, replay=[])
    record = sample.record(tmp_path, sample.proven("box"), other, still)
    replayed, climbed, trust = (one.replace(NBSP, " ") for one in headlines(record))
    assert (
        "on 2 of 3 scenes: of 768 pixels (at 1 and 16 samples each) 1 differs" in replayed
    )
    assert "by 3e-6 of its mean at most" in replayed
    assert "beyond noise on 2 of 2 scenes, and none at all on 1 of 1 scenes w" in climbed
    assert "of 5 % would have been noticed on the median scene, of 8 % on the" in climbed
    assert trust == (
        "Of 1 defects that were built in on purpose the tests catch 1, and of 2 harmless "
        "changes they leave 2 alone; they alarm in 1 of 200 comparisons in which nothing "
        "was changed; 2 of 2 known disagreements are still there."
    )


# ------------------------------------------------------------------------- what is wrong


def test_sound_record_has_no_fault(tmp_path: Path) -> None:
    assert sample.record(tmp_path).faults == []
    assert "✓ 1 of 1 scenes pass, 1 of them replayed, the matrix has no hole" in drawn(
        tmp_path
    )


hole = sample.mutation("gamma-twice", sample.seen("replay", False))
alarm = sample.mutation("worse-sah", sample.seen("replay", True), harmful=False)
broken = sample.mutation("x", sample.seen("runs", True), broken=["replay"])


@pytest.mark.parametrize(
    ("files", "fault", "shown"),
    [
        ({"matrix": sample.matrix(hole)}, "no check catches this", "✗ HOLE: nothing"),
        ({"matrix": sample.matrix(alarm)}, "replay alarms although nothing", "✗ alarm"),
        ({"matrix": sample.matrix(broken)}, "replay also sees the unchanged", "runs"),
        (
            {"register": sample.register(sample.entry("a", measured=0.95,
                                                      verdict="ALARM: agrees now"))},
            "it agrees now", "✗ ALARM: agrees now",
        ),
        (  # a verdict that the number contradicts
            {"register": sample.register(sample.entry("a", measured=0.7))},
            "it was 0.5 and is 0.7 today", '<td class="num outside">0.7</td>',
        ),
        ({"register": sample.register(sample.entry("a", measured=None))}, "is None today",
         "no number"),
        ({"false_alarms": sample.alarms(low=0.01)}, "alarms more often than it claims",
         "1 of 200 ✗"),
    ],
)  # fmt: skip
def test_fault_is_named_at_the_top_and_where_it_stands(
    tmp_path: Path, files: dict[str, Any], fault: str, shown: str
) -> None:
    record = sample.record(tmp_path, **files)
    assert len(record.faults) == 1
    assert fault in record.faults[0]
    page = proof_page(record, tmp_path)
    assert "banner pass" not in page
    assert page.index("✗ 1 thing is not as expected") < page.index('<main id="content">')
    assert shown in page[page.index('<main id="content">') :]


def test_pass_that_replay_or_ladder_contradicts_is_a_failure(tmp_path: Path) -> None:
    """The file says pass; its replay lets 40 pixels diverge, or its rung is broken."""
    for name, changes in (
        ("a", {"replay": [sample.replay(16, 40, passed=True)]}),
        ("b", {"replay": [sample.replay(16, rmse=2e-5)]}),
        ("c", {"rungs": [sample.rung("mean", passed=False)]}),
    ):
        found = sample.record(tmp_path / name, sample.proven("box", **changes))
        assert found.results.scenes[0].verdict == "fail", name
        assert found.faults, name


def test_failing_scenes_and_holes_come_first(tmp_path: Path) -> None:
    scenes = sample.proven("sound"), sample.proven("shifted", "fail"), stopped_scene("gone")
    rows = sample.matrix()["rows"]
    entries = sample.entry("as-ever"), sample.entry("new", measured=0.7)
    page = drawn(
        tmp_path,
        *scenes,
        matrix=sample.matrix(*rows, hole),
        register=sample.register(*entries),
    )
    links = re.findall(r'<th scope="row"><a href="#scene-(\w+)"', page)
    sections = re.findall(r'<section class="scene \w+" id="scene-(\w+)"', page)
    assert links == sections == ["shifted", "gone", "sound"]
    assert page.index(">gamma-twice<") < page.index(">cosine-dropped<")
    assert page.index(">new<") < page.index(">as-ever<")


def test_table_marks_the_number_that_is_over_its_limit(tmp_path: Path) -> None:
    """12 pixels diverge where 1 may; beside it the RMSE is 2e-5 where 1e-5 may be."""
    replays = [sample.replay(1, 12), sample.replay(16, rmse=2e-5, passed=False)]
    page = drawn(tmp_path, sample.proven("box", "fail", replay=replays))
    assert re.search(r'outside">✗ 12 <.*?</td><td class="num">2.5e-7<', page)
    assert re.search(r'<td class="num">0 <.*?</td><td class="num outside">✗ 2e-5<', page)


# ------------------------------------------------------------------------------ the page


def test_page_names_everything_and_loads_nothing(tmp_path: Path) -> None:
    parted = sample.proven("box", replay=[sample.replay(1), sample.replay(16, 1)])
    page = drawn(tmp_path, parted)
    for wanted in (
        "bounce 2: a shadow ray passes an edge by 3e-8",
        '<circle cx="3.5" cy="4.5"',
        "Rung registration came out well.",
        "relative bias of the whole picture",
        "Histogram of p-values: 50 in the first of 4 bins, expected 35",
        "✓ first",
        "does cosine-dropped",
        "<dt>cosine-dropped, statistics</dt><dd>what statistics found <",
        ">unchanged<",
        f"0.5{NBSP}% <span",
        "why far spheres fails",
        "0.4 to 0.6",
        "0.9 to ∞",
        "Example CPU",
        "0123abc",
        "python -m mitsuba_ref.mutations",
    ):
        assert wanted in page, wanted
    addresses = re.findall(r'(?:href|src)="([^"#]*)[^"]*"', page)
    assert all(a in ("", "index.html") or a.startswith("data:") for a in addresses)
    anchors = re.findall(r'id="([^"]+)"', page)
    assert len(anchors) == len(set(anchors))
    assert set(re.findall(r'href="#([^"]+)"', page)) <= set(anchors)


def test_missing_parts_are_said_to_be_missing(tmp_path: Path) -> None:
    """Results alone: no register, no matrix, no false alarms, and how to get them."""
    path = sample.write_proof(tmp_path, sample.proven("box"))
    page = proof_page(read_proof_record(path), tmp_path)
    assert page.count("Not measured in this run.") == 3
    assert "was not measured in this run" in page
    assert "python -m reports.proof --mutations" in page


def test_scene_without_replay_ladder_and_maps_is_drawn(tmp_path: Path) -> None:
    """A results.json of before this page, and a scene that stopped."""
    page = drawn(tmp_path, rendered_scene("old", "pass"), stopped_scene("gone"))
    assert page.count("not replayed") == 0  # no scene has a replay: there is no column
    assert page.count("not climbed") == 2
    page = drawn(tmp_path, rendered_scene("old", "pass"), sample.proven("box"))
    assert page.count("not replayed") == 2


def test_replay_of_two_sizes_is_a_sentence_not_a_picture(tmp_path: Path) -> None:
    """The harness keeps both pictures; they cannot be subtracted, and the page is drawn."""
    sizes = sample.replay(
        1, passed=False, verdict="size-mismatch", sentence="16 x 12, 9 x 9"
    )
    record = sample.record(tmp_path, sample.proven("box", "fail", replay=[sizes]))
    np.save(tmp_path / "box/replay_reference.npy", np.ones((9, 9, 3), np.float32))
    page = proof_page(record, tmp_path)
    assert '<td colspan="5" class="meaning">16 x 12, 9 x 9</td>' in page
    assert "Our picture with Mitsuba" not in page


def test_text_of_the_records_is_escaped(tmp_path: Path) -> None:
    hostile = "<script>alert(1)</script>"
    row = sample.mutation(hostile, sample.seen(hostile, True, why=hostile), does=hostile)
    parted = sample.replay(16, 1, sentence=hostile)
    parted["listed"][0]["cause"] = hostile
    page = drawn(
        tmp_path,
        sample.proven("box", replay=[parted], rungs=[sample.rung(hostile, passed=False)]),
        matrix=sample.matrix(row),
        register=sample.register(sample.entry(hostile, verdict=hostile)),
    )
    assert "<script>alert" not in page
    assert page.count("&lt;script&gt;alert") > 8


# ------------------------------------------------------------------------ matrix, charts


def test_matrix_orders_rungs_from_cheap_to_dear(tmp_path: Path) -> None:
    """Columns follow the ladder whatever row has them first; unknown ones come last."""
    rows = sample.matrix(
        sample.mutation("a", sample.seen("unit tests", True), sample.seen("new", False)),
        sample.mutation("b", sample.seen("runs", False), sample.seen("replay", True)),
    )
    record = sample.record(tmp_path, matrix=rows)
    assert record.matrix is not None
    table = mutation_table(record.matrix.rows)
    assert table.columns == ("runs", "replay", "unit tests", "new")
    texts = [[cell.text for cell in row.cells] for row in table.harmful]
    assert texts == [["·", "·", "✓ first", "no"], ["no", "✓ first", "·", "·"]]


def test_p_map_counts_the_smallest_of_three_thrice() -> None:
    p = np.array([[[0.5, 0.9, 1.0], [0.01, 0.2, 0.3], [1.0, np.nan, 1.0]]])
    found = evidence_against(p)
    assert found[0, :2] == pytest.approx([0.0, -np.log(0.03)])
    assert found[0, 2] > 600  # what is no number is as bright as can be
