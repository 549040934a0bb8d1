"""The page of one study of accelerators, accelerators.html."""

from __future__ import annotations

from markupsafe import Markup

from reports.accelerator_page.scene_tables import SHOWN
from reports.accelerator_page.section import build_accelerators_section
from reports.accelerator_study.further_studies import FURTHER_STUDIES
from reports.accelerator_study.record import AcceleratorStudy
from reports.look.template import fill


def accelerators_page(study: AcceleratorStudy) -> str:
    """Return the whole page as HTML."""
    further = [
        {
            "anchor": key,
            "title": one.title,
            "content": Markup(one.section(study.further[key])),
        }
        for key, one in FURTHER_STUDIES.items()
        if key in study.further
    ]
    return fill(
        "speed/accelerators.html",
        section=build_accelerators_section(study),
        shown_kinds=SHOWN,
        further=further,
    )
