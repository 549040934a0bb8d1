"""Settings of the site for Sphinx: `make docs`; docs/decisions/documentation-site.md."""

from __future__ import annotations

import sys
from pathlib import Path

SITE = Path(__file__).parent
ROOT = SITE.parents[1]
sys.path[:0] = map(str, (ROOT, SITE))  # of this clone, whatever is installed

from renderer.process.names import VERSION  # noqa: E402

project = "lightproof"
author = "lightproof contributors"
version = release = VERSION
copyright = f"2026, {author}. BSD-3-Clause licence"
language = "en"

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "source_pages"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["site"]
nitpicky = True
nitpick_ignore = [("py:exc", "PluginError")]  # a SceneError, which has its entry

# ------------------------------------------------------------------------------ pages

myst_enable_extensions = ["html_image"]
myst_heading_anchors = 3
myst_url_schemes = ["http", "https", "mailto", "source"]  # the last: source_pages.py
suppress_warnings = ["myst.header"]  # pages may skip a level of headings

# -------------------------------------------------------------------------- reference

smartquotes = False  # "--spp" has two hyphens
default_role = "code"  # `x` in a docstring
autodoc_typehints = "none"  # the docstrings have shapes and units
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
napoleon_use_param = False
napoleon_preprocess_types = False

# ------------------------------------------------------------------------------- look

html_theme = "furo"
html_title = f"lightproof {VERSION}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_show_sphinx = False
html_copy_source = False
pygments_style = "friendly"
pygments_dark_style = "github-dark"
