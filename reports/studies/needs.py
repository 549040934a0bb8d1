"""What a scene needs: what each simplification loses and saves, and the least model."""

from __future__ import annotations

import argparse
import math
import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import renderer
from mitsuba_ref.records.proof_file import read_proof
from renderer.command.options import definition
from renderer.errors import SceneError
from reports.bench.rows import Row
from reports.bench.study import Bench, described
from reports.errors import OptionError
from reports.look.pictures import (
    LUMINANCE,
    diverging_palette,
    diverging_steps,
    exposure_stops,
    tone_mapped,
)
from reports.pages.needs_page import FULL, FULL_COLOUR, verdict
from reports.trials.scene_files import scene_content, scene_file, scene_names
from reports.trials.simpler_scenes import Simpler, Trial, mean_picture, needs_of


def measure(case: str, bench: Bench) -> Iterator[Row]:
    """Yield the losses of one scene, its least model and the command that renders it."""
    path, given = scene_file(case), bench.options
    tolerance = _number(given, "tolerance", 0.01)
    trial = Trial(
        renderer.load_file(path, **_parameters(path, given)),
        spp=bench.whole("spp", 8 if bench.quick else 32),
        seeds=bench.whole("seeds", 3 if bench.quick else 6, least=3),
        tolerance=tolerance,
        timed=0.05 if bench.quick else 0.25,
        show=bench.show,
    )
    needs = needs_of(trial)
    words = [] if needs.least is None else needs.least.words
    film = trial.scene.description.camera.film
    size = f"{film.crop_width} x {film.crop_height} pixels"

    def row(quantity: str, value: float | str, **more: Any) -> Row:
        return Row(case=case, quantity=quantity, value=value, **more)

    yield row("setting", f"{size}, {trial.seeds} seeds of {trial.spp} samples")
    yield row("tolerance", tolerance)
    yield row("seconds", trial.seconds, unit="s")
    for name, one in needs.simpler.items():
        yield from _rows(case, name, one)
    yield row("without effect", ", ".join(needs.absent))
    for claim in needs.claims:
        checked = ", ".join(claim.words) or ("the file's own" if claim.verbatim else "")
        yield row("left out by the plan", claim.text, contender=checked)
    yield row("least model", " ".join(words))
    yield row("time of the least model", 1.0 if needs.least is None else needs.least.time)
    yield row("command", command(path, words))
    full = mean_picture(trial.full)
    yield bench.picture(case, FULL, tone_mapped(full, exposure_stops(full)))
    scale = FULL_COLOUR * float((full.astype(np.float64) @ LUMINANCE).mean()) or 1.0
    for name, one in needs.simpler.items():
        difference = one.difference.astype(np.float64) @ LUMINANCE
        steps = diverging_steps(difference, scale)
        yield bench.picture(case, name, diverging_palette()[steps])


def _rows(case: str, name: str, one: Simpler) -> Iterator[Row]:
    loss = one.loss
    for quantity, value, interval in (
        ("loss", loss.error, (loss.error_low, loss.error_high)),
        ("mean", loss.mean, _around(loss.mean, loss.mean_half_width)),
        ("worst tile", loss.tile, _around(loss.tile, loss.tile_half_width)),
        ("FLIP", loss.flip, None),
        ("time", one.time, one.time_interval),
        ("noise", loss.noise, None),
    ):
        yield Row(
            case=case, contender=name, quantity=quantity, value=value, interval=interval
        )


def _around(value: float, half_width: float) -> tuple[float, float]:
    return value - half_width, value + half_width


def command(path: Path, words: Sequence[str]) -> str:
    """Return the command that renders the model."""
    named = [part for word in words for part in ("--simplify", word)]
    return shlex.join(["python", "-m", "renderer", str(path), *named])


def content(case: str, options: Mapping[str, str]) -> str:
    """Return a hash of what a case reads; "" if it cannot be read."""
    try:
        return scene_content(case, _parameters(scene_file(case), options))
    except (SceneError, OptionError, OSError):
        return ""


def _parameters(path: Path, options: Mapping[str, str]) -> dict[str, Any]:
    if defined := options.get("define"):
        try:
            return dict(definition(word) for word in defined.split(","))
        except argparse.ArgumentTypeError as error:
            raise OptionError(f"--set define={defined}: {error}") from None
    size = read_proof(path).test
    return {} if size is None else dict(size.parameters)


def _number(options: Mapping[str, str], name: str, default: float) -> float:
    text = options.get(name, str(default))
    try:
        value = float(text.removesuffix("%")) / (100.0 if text.endswith("%") else 1.0)
    except ValueError:
        value = math.nan
    if not 0.0 <= value < math.inf:
        raise OptionError(f"--set {name}={text}: expected a number from 0 or per cent")
    return value


STUDY = described(
    "needs",
    cases=scene_names,
    any_case=True,
    inputs=content,
    verdict=verdict,
    measure=measure,
)
