"""The trials of `make soak`, in the order in which they run."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

from reports.soak import self_hits
from reports.soak.damaged_files import damaged_file_steps
from reports.soak.growth import growth_steps
from reports.soak.interrupts import interrupt_steps
from reports.soak.rays import trial as rays
from reports.soak.record import Part, Step


@dataclass(frozen=True)
class Study:
    """One trial."""

    name: str
    title: str
    unit: str
    wanted: int  # of the unit, over all sessions
    about: str
    steps: Callable[[Part, float], Iterator[Step]]  # (what was done, deadline)
    # of some of its counts, by name: sums hide that one of them is behind
    wanted_of: Mapping[str, int] = field(default_factory=dict)

    def complete(self, part: Part) -> bool:
        """Return whether a trial has done all that is wanted."""
        return part.done >= self.wanted and all(
            part.counts.get(name, 0) >= wanted for name, wanted in self.wanted_of.items()
        )


def _from_number(
    steps: Callable[[int, float], Iterator[Step]],
) -> Callable[[Part, float], Iterator[Step]]:
    """Return the steps of a trial that goes on from the number of what was done."""
    return lambda part, deadline: steps(part.done, deadline)


STUDIES = (
    Study(
        "rays",
        "Rays in closed meshes",
        "rays",
        sum(rays.WANTED.values()),
        "Rays from inside of six closed meshes, most of them in one of 20 triangles, "
        f"the same for each of {len(rays.STRUCTURES)} structures (but that brute force, "
        "boxes and the BSP tree have the smallest mesh in the place of large ones), asked "
        "for the nearest hit one by one and in packets, and for any hit. "
        "Half go anywhere, half are aimed to pass edges and vertices at 10^-8 to 10^-2 "
        "of an edge. A leak is a ray that meets nothing although it meets a triangle by "
        "more than the rounding of the test can do, for this ray and triangle, or although "
        "another structure finds a hit. Nearer to an edge a ray may be lost, because "
        "neighbouring triangles do not share it exactly; these are counted beside it. (The "
        "first 2.2 * 10^9 rays were judged by a fixed distance, 10^-6 of the largest "
        "coordinate.)",
        rays.ray_steps,
        rays.WANTED,
    ),
    Study(
        "self-hits",
        "Rays that leave a surface",
        "rays",
        self_hits.WANTED,
        "Mitsuba's 44 cases: eleven shapes at four places and sizes are hit from four "
        "sizes away, rays leave into the hemisphere above each hit, and none may meet "
        "anything within a thousandth of the shape. Four shapes that this renderer lacks "
        "have their nearest kin.",
        _from_number(self_hits.self_hit_steps),
    ),
    Study(
        "damaged-files",
        "Damaged files",
        "files",
        10**6,
        "Every format that is read, and whole scenes: extreme values in well-formed XML, "
        "headers that lie, streams of deflate with flipped bits, and damage that knows "
        "nothing of the format. Each is read and, if it is read, rendered with one sample. "
        "It must end in a SceneError or a finite picture, within 10 s of processor time "
        "and 1 GiB; a warning of NumPy is a fault too. Films above 16384 pixels and paths "
        "above 64 bounces or samples of light are read and not rendered.",
        _from_number(damaged_file_steps),
    ),
    Study(
        "interrupts",
        "Ctrl-C at random moments",
        "interrupts",
        1000,
        "The command in a process of its own, interrupted between its start and after its "
        "end: the picture so far or nothing, with one line that says which. A traceback, a "
        "picture that cannot be read, another file, another status and a program that goes "
        "on are faults. Python itself, before it comes to the program's first line, "
        "answers as Python does.",
        _from_number(interrupt_steps),
    ),
    Study(
        "growth",
        "Memory of one process",
        "pictures",
        10**6,
        "All scenes of the repository in turn in one process, memory after each round. The "
        "first half of the rounds is left out; the medians of 20 blocks of the others are "
        "tested for a trend (Kendall's S against random orders of the blocks). Growth is "
        "p <= 0.001 and 1 MiB or more: blocks without a trend alarm in at most 0.1 % of "
        "all processes.",
        _from_number(growth_steps),
    ),
)
