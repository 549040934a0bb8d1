"""Numbers as a reader wants them: three digits that matter, a dash for nothing."""

from __future__ import annotations

import html
import re

from markupsafe import Markup

from mitsuba_ref.records.verdicts import VERDICTS, Verdict

NOTHING = "–"  # noqa: RUF001  an en dash, as tables print it

METRIC_NAMES = {
    "rmse": "RMSE",
    "trimmed_rmse": "trimmed RMSE",
    "tile_rmse": "tile RMSE",
    "rmse_everywhere": "RMSE, edges included",
    "rmse_with_filter": "RMSE with filter",
    "relative_mse": "relative MSE",
    "ssim": "SSIM",
    "flip": "FLIP",
    "ciede2000": "CIEDE2000",
    "ciede2000_p99": "CIEDE2000, 99 %",
    "mean_difference": "mean difference",
}

VERDICT_SIGNS: dict[Verdict, str] = {
    verdict: {"pass": "✓ pass", "fail": "✗ fail"}.get(verdict, f"! {verdict}")
    for verdict in VERDICTS
}
VERDICT_STYLES: dict[Verdict, str] = {  # classes of the style sheet
    verdict: verdict if verdict in ("pass", "fail") else "error" for verdict in VERDICTS
}

_EXPONENT = re.compile(r"\^(\([^)]*\)|-?\d+)")
_POWER = re.compile(r"(?<![\w^])(\d[\d.]*)e([+-]?\d+)")


def number(value: float | None, digits: int = 3) -> str:
    """Return `digits` significant digits: 0.0123, 12.3, 3.6e-8; a dash for None."""
    if value is None:
        return NOTHING
    if value == 0.0:
        return "0"
    if not 1e-4 <= abs(value) < 1e6:
        mantissa, power = f"{value:.{digits - 1}e}".split("e")
        return f"{float(mantissa):g}e{int(power)}"
    shown = f"{value:.{digits}g}"
    return f"{float(shown):.0f}" if "e" in shown else shown


def seconds(value: float | None) -> str:
    """Return a duration with its unit: 31 ms, 2.65 s, 3 min 20 s; a dash for None."""
    if value is None:
        return NOTHING
    if value < 0.1:
        return f"{number(value * 1e3, 2)} ms"
    if value < 100.0:
        return f"{value:.3g} s"
    minutes, rest = divmod(round(value), 60)
    return f"{minutes} min {rest} s"


def judgement(passed: bool | None) -> str:
    """Return what a table says about one comparison."""
    return {True: "✓ within", False: "✗ outside", None: "not judged"}[passed]


def metric_name(key: str) -> str:
    """Return the name that people know a metric by."""
    return METRIC_NAMES.get(key, key.replace("_", " "))


def percent(share: float | None) -> str:
    """Return 0.0023 as "0.23 %", without a line break before the sign; a dash for None."""
    return NOTHING if share is None else number(100.0 * share, 2) + "\u00a0%"


def slug(text: str) -> str:
    """Return a text as part of a file's name."""
    return re.sub(r"[^\w.=+-]+", "-", text).strip("-.") or "unnamed"


def marked_up(text: str) -> Markup:
    """Return the text as HTML: `code`, and exponents raised (10^-3, n^(1/3), 1e-3)."""
    pieces = []
    for place, part in enumerate(text.split("`")):
        safe = html.escape(part)
        if place % 2:
            pieces.append(f"<code>{safe}</code>")
        else:
            pieces.append(_EXPONENT.sub(_raised, _POWER.sub(_written_out, safe)))
    return Markup("".join(pieces))


def _raised(found: re.Match[str]) -> str:
    return f"<sup>{found[1].strip('()')}</sup>"


def _written_out(found: re.Match[str]) -> str:
    factor, power = found[1], int(found[2])
    return f"10^{power}" if factor == "1" else f"{factor} · 10^{power}"
