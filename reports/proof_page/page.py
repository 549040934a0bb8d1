"""The page of what the scenes prove, proof.html."""

from __future__ import annotations

from pathlib import Path

from mitsuba_ref.replay.replay_comparison import TOLERANCE
from reports.look.template import fill
from reports.proof_page.record import ProofRecord
from reports.proof_page.section import build_proof_section
from reports.proof_page.sentences import detectable, percent


def proof_page(record: ProofRecord, folder: Path) -> str:
    """Return the whole page as HTML; its pictures are named from `folder`.

    Raises
    ------
    ReportError
        If a picture is missing or unusable.
    """
    return fill(
        "proof/proof.html",
        filters={"percent": percent, "detectable": detectable},
        section=build_proof_section(record, folder),
        divergent_from=TOLERANCE,
    )
