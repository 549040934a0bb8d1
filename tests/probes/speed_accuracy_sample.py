"""Hand-made rows of speed against accuracy: two noisy scenes, one without noise."""

from __future__ import annotations

from reports.bench.rows import Row, Run, Table
from reports.studies.speed_accuracy import rows_of

OURS, PEER = "lightproof path", "mitsuba scalar_rgb"


def noisy(
    case: str, contenders: dict[str, tuple[float, float]], **absent: str
) -> list[Row]:
    """Return the rows of contenders with (error, seconds) of one sample.

    Two numbers of samples of two seeds; error x seconds stays.
    """
    errors = {
        n: [[1.1 * e / k, 0.9 * e / k] for k in (4, 16)] for n, (e, _) in contenders.items()
    }
    seconds = {n: [[s * k] * 2 for k in (4, 16)] for n, (_, s) in contenders.items()}
    facts = {
        "size": "8 x 6",
        "seeds": 2,
        "reference": "2048 samples",
        "default of ours": f"{OURS}, independent",
    }
    return [
        *(
            Row(case=case, quantity="unavailable", contender=f"mitsuba {n}", value=why)
            for n, why in absent.items()
        ),
        *(Row(case=case, quantity=name, value=value) for name, value in facts.items()),
        *rows_of(case, (4, 16), errors, seconds),
    ]


def still() -> list[Row]:
    """Return a scene with two structures, two offsets and a peer."""
    rows = [Row(case="teapot", quantity="size", value="8 x 6")]
    for family, error, off in (("offset tight", 1e-6, 0), ("offset mitsuba", 1e-5, 2)):
        name = f"lightproof direct, {family}"
        for structure, time in (("brute", 0.4), ("wide", 0.01)):
            rows.append(
                Row(
                    case="teapot",
                    contender=f"{name}, {structure}",
                    quantity="seconds",
                    value=time,
                    interval=(time, 2 * time),
                )
            )
        rows.append(Row(case="teapot", contender=name, quantity="error", value=error))
        rows.append(Row(case="teapot", contender=name, quantity="pixels off", value=off))
    for quantity, value in (("seconds", 0.1), ("error", 0.0), ("pixels off", 0)):
        rows.append(Row(case="teapot", contender=PEER, quantity=quantity, value=value))
    return rows


def box(**absent: str) -> list[Row]:
    """Return a scene on which ours is worth twice the best peer."""
    return noisy(
        "box",
        {
            f"{OURS}, independent": (1.0, 0.5),
            f"{OURS}, sobol": (0.5, 0.25),
            f"{PEER}, independent": (1.0, 1.0),
            f"{PEER}, multijitter": (0.5, 0.5),
        },
        **absent,
    )


def room() -> list[Row]:
    """Return a scene on which ours is worth half the best peer, by its own method."""
    return noisy(
        "room",
        {
            f"{OURS}, independent": (1.0, 1.0),
            f"{OURS}, sobol": (1.0, 2.0),
            "lightproof whitted, independent": (1.0, 4.0),
            f"{PEER}, independent": (0.5, 1.0),
        },
        llvm_ad_rgb="no <LLVM>",
    )


def table(*rows: list[Row], machine: dict[str, object] | None = None) -> Table:
    """Return rows of one run; of all scenes if none are given."""
    every = [
        row
        for part in rows or (box(llvm_ad_rgb="no <LLVM>"), room(), still())
        for row in part
    ]
    run = Run(run="", created="2026-01-02", command="c", machine=machine or {"cores": 2})
    return Table(tuple(every), {"": run})
