"""How often the ladder of tests alarms where nothing is wrong, against what it claims."""

from __future__ import annotations

from collections.abc import Iterator

from mitsuba_ref.false_alarms.alarm_counts import WHOLE, FalseAlarms, exceeds
from mitsuba_ref.false_alarms.measure import measure as count
from mitsuba_ref.false_alarms.measure import measure_convergence_alarms
from mitsuba_ref.records.request import FEWEST_SEEDS
from reports.bench.rows import Row, Table
from reports.bench.study import Bench, described
from reports.trials.compared_scenes import option
from reports.trials.scene_files import scene_content, scene_file

SIZE, SPP = 32, 16  # pixels a side, samples per pixel


def measure(case: str, bench: Bench) -> Iterator[Row]:
    """Climb the ladder on pairs of the same scene; yield each rung's rate of alarms."""
    pairs, path = 20 if bench.quick else 200, scene_file(case)
    found = [*count(path, pairs, SIZE, SPP, FEWEST_SEEDS, bench.show)]
    if option(bench, "convergence", ("no", "yes")) == "yes":
        found.append(measure_convergence_alarms(path, pairs, SIZE, bench.show))
    for one in found:
        yield from rows_of(case, one)


def rows_of(case: str, one: FalseAlarms) -> Iterator[Row]:
    """Yield the rows of one comparison of a scene with itself."""
    for rung in one.rungs:
        rates = {"rate of alarms": rung.alarms, "p up to 5 %": rung.below_often}
        contender = f"{one.comparison}: {rung.name}"
        for quantity, rate in rates.items():
            if rate is not None:
                yield Row(
                    case=case,
                    contender=contender,
                    quantity=quantity,
                    value=rate.value,
                    interval=(rate.low, rate.high),
                )
        values = {
            "claimed rate": rung.claimed,
            "comparisons": float(rung.alarms.trials),
            "detectable bias": rung.detectable_bias,
        }
        for quantity, value in values.items():
            if value is not None:
                yield Row(case=case, contender=contender, quantity=quantity, value=value)
    if exceeds(one):
        sentence = f"{one.comparison}: the ladder alarms more often than it claims"
        yield Row(case=case, quantity="fault", value=sentence)


def verdict(table: Table) -> str:
    """Return how often the whole ladder alarms."""
    whole = {row.contender for row in table if row.contender.endswith(f": {WHOLE}")}
    trials = {
        (row.case, row.contender): int(row.value or 0)
        for row in table.where(quantity="comparisons")
        if row.contender in whole
    }
    alarms = sum(
        round(float(row.value or 0.0) * trials[row.case, row.contender])
        for row in table.where(quantity="rate of alarms")
        if row.contender in whole
    )
    return (
        f"The ladder of tests alarms in {alarms} of {sum(trials.values())} comparisons in "
        "which nothing is wrong."
    )


STUDY = described(
    "false-alarms",
    cases=("cornell-box", "grey-furnace"),
    inputs=lambda case, options: scene_content(case),
    any_case=True,
    measure=measure,
    verdict=verdict,
)
