"""Measures pictures and rays beside peers, whole, as one record."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime

from mitsuba_ref.records import machine
from reports.beside_peers.pictures import time_pictures
from reports.beside_peers.rays import time_rays
from reports.beside_peers.record import PeersRecord


def measure_peers(
    threads: int, rounds: int, command: str, progress: Callable[[str], None]
) -> PeersRecord:
    """Time all pictures, then all rays; these by one thread as well.

    Raises
    ------
    ReportError
        If pictures or hits disagree: speed of what is wrong is no speed.
    """
    pictures = time_pictures(threads, rounds, progress)
    rays = time_rays(sorted({1, threads}), rounds, progress)
    return PeersRecord(
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        command=command,
        commit=machine.current_commit(),
        machine=machine.describe_machine(),
        versions=machine.installed_versions(),
        threads=threads,
        pictures=pictures,
        rays=rays,
    )
