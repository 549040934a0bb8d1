"""The script that draws charts, as part of a page: nothing is loaded from anywhere.

plotly.js has 4.8 MB; compressed it is 1.5 MB, and as text of a page 2 MB. Each browser
since 2023 unpacks it by itself.
"""

from __future__ import annotations

import base64
import functools
import gzip

from markupsafe import Markup
from plotly.offline import get_plotlyjs


@functools.cache
def packed_library() -> Markup:
    """Return plotly.js, gzip in base64; the same bytes for the same version."""
    packed = gzip.compress(get_plotlyjs().encode(), 9, mtime=0)
    return Markup(base64.b64encode(packed).decode("ascii"))
