"""Fills a template: one self-contained page, or a part of one."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from mitsuba_ref.records.failures import failures
from mitsuba_ref.records.other_programs import busy_sentence
from mitsuba_ref.records.verdicts import VERDICTS
from reports.look import formatting, heat_map, pictures

Filter = Callable[..., str]
FILTERS: dict[str, Filter] = {
    "number": formatting.number,
    "seconds": formatting.seconds,
    "judgement": formatting.judgement,
    "metric_name": formatting.metric_name,
    "percent": formatting.percent,
    "marked": formatting.marked_up,
}


def fill(template: str, filters: Mapping[str, Filter] | None = None, **context: Any) -> str:
    """Return the HTML; a name that the template uses and `context` lacks is an error.

    Parameters
    ----------
    template
        A file in reports/templates.
    filters
        Further ways to write a value; functions of a module, as a template is compiled
        once for each set of them.
    **context
        What the template shows; all of it is escaped but `Markup`.
    """
    environment = _environment(frozenset((filters or {}).items()))
    return environment.get_template(template).render(**context)


@functools.cache
def _environment(filters: frozenset[tuple[str, Filter]]) -> Environment:
    environment = Environment(
        loader=PackageLoader("reports"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update({**FILTERS, **dict(filters)})
    environment.globals.update(
        busy_sentence=busy_sentence,
        failures=failures,
        work_ramp=heat_map.ramp_css(),
        verdict_signs=formatting.VERDICT_SIGNS,
        verdict_styles=formatting.VERDICT_STYLES,
        verdict_facts=VERDICTS,
        ramp_colours=", ".join(
            "rgb({:.0f} {:.0f} {:.0f})".format(*colour) for colour in pictures.DIVERGING
        ),
    )
    return environment
