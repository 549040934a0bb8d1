"""The former name of `renderer.plugins`, for one version: BSDFs of users import it."""

import sys
import warnings

from renderer.plugins import bsdfs
from renderer.plugins.bsdfs import kind

warnings.warn(
    "renderer.kinds.bsdfs.kind is now renderer.plugins.bsdfs.kind",
    FutureWarning,
    stacklevel=2,
)
# `import renderer.kinds.bsdfs.kind` finds these before it looks for files
sys.modules[f"{__name__}.bsdfs"] = bsdfs
sys.modules[f"{__name__}.bsdfs.kind"] = kind
