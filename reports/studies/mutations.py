"""Defects built into copies of the renderer: and the check that sees each of them first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager

from mitsuba_ref.mutations.defects.catalogue import CATALOGUE
from mitsuba_ref.mutations.matrix import Row as MatrixRow
from mitsuba_ref.mutations.matrix import SharedReferences, control, try_mutation
from mitsuba_ref.mutations.mutation import Mutation
from mitsuba_ref.records.machine import usable_cores
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.picture_process import MitsubaWorker
from reports.bench.rows import Row, Table
from reports.bench.study import Bench, described

MOST_JOBS = 8  # mutants at a time; each compiles on one core
MUTATIONS = {mutation.name: mutation for mutation in CATALOGUE}


@contextmanager
def session(cases: Sequence[str], bench: Bench) -> Iterator[dict[str, Future[MatrixRow]]]:
    """Try all mutations in threads: first the unchanged renderer on each of their scenes.

    A rung that sees the unchanged renderer says nothing about a mutant on that scene.
    """
    wanted = [MUTATIONS[case] for case in cases]
    with MitsubaWorker() as worker:
        references = SharedReferences(ReferenceCache(worker.render))
        pool = ThreadPoolExecutor(min(usable_cores(), MOST_JOBS))
        unchanged = {
            scene: pool.submit(try_mutation, control(scene), references)
            for scene in dict.fromkeys(mutation.scene for mutation in wanted)
        }

        def one(mutation: Mutation) -> MatrixRow:
            rungs = unchanged[mutation.scene].result().rungs
            broken = [rung.name for rung in rungs if rung.caught]
            return try_mutation(mutation, references, broken)

        try:
            yield {mutation.name: pool.submit(one, mutation) for mutation in wanted}
        finally:
            pool.shutdown(cancel_futures=True)


def measure(case: str, bench: Bench) -> Iterator[Row]:
    """Wait for a mutation; yield what it does and what each rung says of it."""
    return rows_of(bench.session[case].result())


def rows_of(tried: MatrixRow) -> Iterator[Row]:
    """Yield the rows of one mutation."""
    case, first = tried.mutation, tried.caught_by
    texts = {
        "what is changed": tried.does,
        "scene": tried.scene,
        "kind": "defect" if tried.harmful else "harmless",
        "seen first by": first or "no check",
        "remark": tried.remark,
    }
    for quantity, text in texts.items():
        if text:
            yield Row(case=case, quantity=quantity, value=text)
    for rung in tried.rungs:
        yield Row(
            case=case,
            contender=rung.name,
            quantity="seen",
            value="seen" if rung.caught else "no",
        )
        if rung.name == first:
            yield Row(case=case, quantity="because", value=rung.why[:200])
            yield Row(case=case, quantity="after", unit="s", value=round(rung.seconds, 2))
    if not tried.as_expected:
        yield Row(case=case, quantity="fault", value=_unexpected(tried))


def _unexpected(tried: MatrixRow) -> str:
    if tried.broken:
        return f"{', '.join(tried.broken)} also sees the unchanged renderer"
    if not tried.compiles:
        return "it does not compile any more, so that it shows nothing"
    if tried.harmful:
        return "no check sees this defect"
    return f"{tried.caught_by} alarms although nothing is wrong"


def verdict(table: Table) -> str:
    """Return how many of the defects are seen, and how many harmless changes are not."""
    kinds = {row.case: row.value for row in table.where(quantity="kind")}
    seen = {row.case for row in table.where(quantity="seen", value="seen")}
    defects = [case for case, kind in kinds.items() if kind == "defect"]
    harmless = [case for case, kind in kinds.items() if kind != "defect"]
    return (
        f"The checks see {sum(case in seen for case in defects)} of {len(defects)} defects "
        f"that were built in on purpose, and leave "
        f"{sum(case not in seen for case in harmless)} of {len(harmless)} harmless changes "
        "alone."
    )


STUDY = described(
    "mutations",
    cases=tuple(MUTATIONS),
    quick_cases=tuple(MUTATIONS)[:6],
    session=session,
    measure=measure,
    verdict=verdict,
)
