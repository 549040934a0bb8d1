"""Colours: every form of the file as the linear sRGB that Mitsuba's scalar_rgb uses."""

from __future__ import annotations

from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest
from scene_file_samples import error_of, mitsuba_refuses, ours, parameter, theirs
from scene_xml import props, tag

from renderer.scene_file.colors.named_materials import MATERIALS

REFLECTANCE = '<shape type="sphere"><bsdf type="diffuse">\n{}</bsdf></shape>'
EMISSION = '<emitter type="point">\n{}</emitter>'

# name, value and whether Mitsuba takes it as a reflectance
SPECTRA = {
    "flat": "400:0.5, 700:0.5",
    "all wavelengths": "360:0.3 830:0.3",
    "three entries": "400:0.1 500:0.9 700:0.2",
    "dense": " ".join(f"{w}:{0.5 + 0.4 * np.sin(w / 30):.4f}" for w in range(360, 831, 7)),
    "narrow": "500:1 540:1",
    "a single step wide": "500:1 501:1",
    "red end": "650:0.2 830:0.9",
    "blue end": "300:0.2 420:0.9",
    "outside of the visible": "900:1 1000:1",
    "above one": "400:2 700:3",
}


def reflectance(value: str, folder: Path | None = None) -> tuple[np.ndarray, np.ndarray]:
    content = REFLECTANCE.format(value)
    mine = np.array(ours(content, folder=folder).shapes[0].bsdf.reflectance.rgb)
    reference = theirs(content, folder=folder).shapes()[0].bsdf()
    return mine, parameter(reference, "reflectance.value")


def emission(value: str) -> tuple[np.ndarray, np.ndarray]:
    content = EMISSION.format(value)
    mine = np.array(ours(content).emitters[0].intensity)
    return mine, parameter(theirs(content).emitters()[0], "intensity.value")


@pytest.mark.parametrize("text", SPECTRA.values(), ids=SPECTRA)
def test_wavelength_list_has_the_colour_of_mitsuba(text: str) -> None:
    """As a reflectance (under D65, clamped to [0, 1]) and as emission (neither)."""
    for mine, reference in (
        reflectance(f'<spectrum name="reflectance" value="{text}"/>'),
        emission(f'<spectrum name="intensity" value="{text}"/>'),
    ):
        np.testing.assert_allclose(mine, reference, rtol=2e-5, atol=1e-6)


@pytest.mark.parametrize(
    "value",
    [
        '<rgb name="{}" value="0.1, 0.2 0.3"/>',
        '<rgb name="{}" value="0.5"/>',
        '<float name="{}" value="0.3"/>',
        '<integer name="{}" value="1"/>',
        '<spectrum name="{}" value="0.5"/>',
        '<spectrum type="uniform" name="{}"><float name="value" value="0.2"/></spectrum>',
        '<spectrum type="srgb" name="{}"><rgb name="color" value="0.2 0 1"/></spectrum>',
        '<spectrum type="d65" name="{}"><float name="scale" value="0.25"/></spectrum>',
        "",
    ],
)
def test_other_forms_have_the_colour_of_mitsuba(value: str) -> None:
    """Notably: a uniform `<spectrum>` is grey as a reflectance, pinkish as emission."""
    np.testing.assert_allclose(*reflectance(value.format("reflectance")), rtol=1e-6)
    np.testing.assert_allclose(*emission(value.format("intensity")), rtol=1e-6)


def test_spd_file(tmp_path: Path) -> None:
    (tmp_path / "paint.spd").write_text("# a comment\n400 0.2\n\n500.5 0.8\n700 1e-1\n")
    mine, reference = reflectance(
        '<spectrum name="reflectance" filename="paint.spd"/>', folder=tmp_path
    )
    np.testing.assert_allclose(mine, reference, rtol=2e-5)


def test_all_conductors_of_mitsuba_are_known() -> None:
    """Mitsuba ships a pair of spectra for each; nothing else is a name."""
    folder = Path(mi.__file__).parent / "data" / "ior"
    assert set(MATERIALS) == {p.name.removesuffix(".k.spd") for p in folder.glob("*.k.spd")}


def test_conductor_indices_are_those_of_mitsuba() -> None:
    content = "".join(
        '<shape type="sphere"><bsdf type="conductor"><string name="material" '
        f'value="{name}"/>'
        "</bsdf></shape>"
        for name in (*MATERIALS, "none")
    )
    shapes = zip(ours(content).shapes, theirs(content).shapes(), strict=True)
    for shape, reference in shapes:
        bsdf = reference.bsdf()
        np.testing.assert_allclose(
            shape.bsdf.eta.rgb, parameter(bsdf, "eta.value"), rtol=1e-6
        )
        np.testing.assert_allclose(shape.bsdf.k.rgb, parameter(bsdf, "k.value"), rtol=1e-6)


def test_clamped_colours_are_mentioned_in_the_log() -> None:
    laser = tag("spectrum", intensity="500:1 510:1")
    assert "clamped" in ours(EMISSION.format(laser)).warnings[0]
    assert ours(EMISSION.format(props(intensity=2.0))).warnings == ()
    white = tag("spectrum", reflectance="300:1 900:1")
    assert ours(REFLECTANCE.format(white)).warnings == ()


# -------------------------------------------------------------------- errors


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (tag("rgb", reflectance="1.2"), "the colour (1.2, 1.2, 1.2)"),
        (tag("rgb", reflectance="0.5 -0.1 0"), "the colour (0.5, -0.1, 0)"),
        (tag("rgb", reflectance="#ff8000"), '"#ff8000"; expected a finite number'),
        (tag("rgb", reflectance="1 2"), "2 numbers; expected 1 or 3"),
        (props(reflectance="red"), "a value of type string, expected a colour"),
        (tag("vector", reflectance="1 1 1"), "a value of type vector"),
        (tag("spectrum", reflectance="400:0.5"), "1 entries; expected at least two"),
        (tag("spectrum", reflectance="700:0.5 400:1"), "700 and 400 of a spectrum do"),
        (tag("spectrum", reflectance="400:1 400:1"), "400 and 400 of a spectrum do"),
        (tag("spectrum", reflectance="0.5 0.6"), 'entry "0.5"; expected one value, or'),
        (
            '<spectrum name="reflectance"/>',
            '<spectrum> needs one of "value" and "filename"',
        ),
        (
            '<spectrum name="reflectance" value="1" filename="x"/>',
            "<spectrum> needs one of",
        ),
        (
            '<spectrum name="reflectance" filename="x.spd"/>',
            '"x.spd" not found; looked in: ',
        ),
        ('<spectrum type="srgb" name="reflectance"/>', 'property "color": found nothing'),
        (
            '<spectrum type="black" name="reflectance"/>',
            "supported texture plugins: bitmap, ",
        ),
        (tag("rgb", reflectence="1"), 'has no property "reflectence"; supported: refl'),
    ],
)
def test_reflectances_that_are_wrong(value: str, message: str) -> None:
    content = REFLECTANCE.format(value)
    assert error_of(content).startswith(("<string>:2: ", "<string>:3: "))
    assert message in error_of(content)
    assert mitsuba_refuses(content)


@pytest.mark.parametrize(
    "value",
    [props(reflectance=1.5), tag("spectrum", reflectance="2"), props(reflectance=True)],
)
def test_reflectances_that_only_we_refuse(value: str) -> None:
    """Mitsuba checks `<rgb>` alone, though these make energy as well."""
    message = error_of(REFLECTANCE.format(value))
    assert message.startswith('<string>:3: bsdf "diffuse", property "reflectance": found ')


def test_negative_emission_is_refused() -> None:
    message = error_of(EMISSION.format(tag("rgb", intensity="1 -1 1")))
    assert message == (
        '<string>:3: emitter "point", property "intensity": found the colour (1, -1, 1), '
        "expected an emission of at least 0 and at most 1e30"
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("400 0.5 3\n500 1\n", ':1: found "400 0.5 3"; expected a wavelength and a value'),
        ("400 0.5\n500 x\n", ':2: a number is "x"; expected a finite number'),
        ("400 0.5\n", ":1: a spectrum over wavelengths has 1 entries"),
        ("", ":0: a spectrum over wavelengths has 0 entries"),
    ],
)
def test_spd_files_that_are_wrong(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "bad.spd").write_text(text)
    value = '<spectrum name="reflectance" filename="bad.spd"/>'
    found = error_of(REFLECTANCE.format(value), folder=tmp_path)
    assert found.startswith(f"{tmp_path / 'bad.spd'}{message}".replace(":0:", ":"))


def test_spd_file_that_is_no_text(tmp_path: Path) -> None:
    (tmp_path / "bad.spd").write_bytes(b"\xff\xfe\x00")
    value = '<spectrum name="reflectance" filename="bad.spd"/>'
    assert "cannot read the spectrum" in error_of(
        REFLECTANCE.format(value), folder=tmp_path
    )
