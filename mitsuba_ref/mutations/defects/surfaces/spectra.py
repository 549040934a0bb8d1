"""Defects of spectra that are plugins.

A replay sees them although Mitsuba's `scalar_rgb` cannot evaluate such spectra: its side
gets the colours of the unchanged reader. What that one does wrong has to be seen by tests
against Mitsuba's spectral variant and laws of physics, which are named here.
"""

from __future__ import annotations

from mitsuba_ref.mutations.mutation import Edit, Mutation

PLUGINS = "scene_file/colors/spectrum_plugins.py"
LISTS = ("test_spectrum_plugins.py::test_lists_of_all_forms_are_the_same_colour",)
LAWS = (
    "test_spectrum_plugins.py"
    "::test_a_black_body_radiates_by_the_laws_of_stefan_boltzmann_and_wien",
)

DEFECTS = (
    Mutation(
        "regular-spectrum-without-its-end",
        "the last value of a regular spectrum belongs one step before wavelength_max",
        (
            Edit(
                PLUGINS,
                "np.linspace(first, last, max(len(values), 2)).tolist()",
                "np.linspace(first, last, len(values), endpoint=False).tolist()",
            ),
        ),
        scene="spectra",
        tests=LISTS,
    ),
    Mutation(
        "irregular-spectrum-made-regular",
        "the values of an irregular spectrum are spread evenly over its range",
        (
            Edit(
                PLUGINS,
                'wavelengths = _numbers(properties, "wavelengths")',
                'ends = _numbers(properties, "wavelengths")\n'
                "            wavelengths = np.linspace("
                "ends[0], ends[-1], len(ends)).tolist()",
            ),
        ),
        scene="spectra",
        tests=LISTS,
    ),
    Mutation(
        "spectrum-goes-on-beyond-its-ends",
        "beyond its first and last wavelength a spectrum keeps its values",
        (
            Edit(
                "scene_file/colors/spectra.py",
                "np.interp(x, wavelengths, values, left=0.0, right=0.0)",
                "np.interp(x, wavelengths, values)",
            ),
        ),
        scene="spectra",
    ),
    Mutation(
        "black-body-by-wien",
        "a black body radiates by Wien's law, without the 1 that Planck takes off",
        (Edit(PLUGINS, "exponential = np.expm1(", "exponential = np.exp("),),
        scene="spectra",
        tests=LAWS,
        remark="of 1 in 10^5 of the light that is seen at 1800 K",
    ),
    Mutation(
        "black-body-counts-photons",
        "a black body's spectrum is that of its photons instead of their energy",
        (
            Edit(
                PLUGINS,
                "(metres**5 * exponential)",
                "(metres**4 * 5.5e-7 * exponential)",
            ),
        ),
        scene="spectra",
        tests=LAWS,
    ),
)
