"""lightproof under its own name: `import lightproof` is the API of the package `renderer`.

>>> import lightproof
>>> scene = lightproof.load_file("scenes/cornell-box/scene.xml", spp=16)
>>> lightproof.render(scene).save("cornell.exr")
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import renderer
from renderer import __all__
from renderer import __version__ as __version__

if TYPE_CHECKING:
    from renderer import *  # noqa: F403


def __getattr__(name: str) -> Any:
    """Return a public name of the renderer, which imports it when it is used first."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(renderer, name)


def __dir__() -> list[str]:
    """Return the public names too that are not imported yet."""
    return sorted({*globals(), *__all__})


if __name__ == "__main__":  # python -m lightproof
    from renderer.__main__ import command

    command()
