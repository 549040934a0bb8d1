"""The former name of `renderer.plugins`, for one version: BSDFs of users import from it."""

import sys
import warnings
from importlib import import_module

warnings.warn(
    "renderer.kinds is now renderer.plugins, and its BSDFs are in one folder: "
    "renderer.plugins.bsdfs",
    FutureWarning,
    stacklevel=2,
)
# What docs/adding-a-bsdf.md named; Python finds these before it looks for files.
for _former in ("bsdfs", "bsdfs.kind", "bsdfs.rough", "bsdfs.rough.microfacets"):
    _now = "renderer.plugins." + _former.replace(".rough", "")
    sys.modules[f"{__name__}.{_former}"] = import_module(_now)
