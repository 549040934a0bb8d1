"""An EXR file written some rows at a time: what is in the file was never in memory at once.

The file is the same, byte for byte, as the one that `Image.save` writes of the whole
picture. Of OpenEXR's Python interface only the older class can write so; it has scan lines
alone and no tiles.
"""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from renderer.errors import SceneError
from renderer.picture.image import Image
from renderer.picture.image_files import check_output_path, exr_planes, whole_or_not_at_all


class ExrRows:
    """A file that grows from the top; it appears when it is whole, or not at all.

    Parameters
    ----------
    path
        It must end in .exr.
    width, height
        Of the whole picture.

    Raises
    ------
    SceneError
        If it cannot be written; `add` too.
    """

    def __init__(self, path: Path, width: int, height: int) -> None:
        check_output_path(path)
        if path.suffix.lower() != ".exr":
            raise SceneError(f"{path}: rows can be written to an .exr file alone")
        self._path, self._size = path, (width, height)
        self._in_place = whole_or_not_at_all(path)
        self._stack = ExitStack()
        self._file: Any = None

    def __enter__(self) -> Self:
        """Return the file."""
        self._temporary = self._stack.enter_context(self._in_place)
        self._stack.callback(self._close)  # an error of it too leaves no file
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the file and give it its name; after an error it is deleted."""
        self._stack.__exit__(kind, error, trace)

    def add(self, rows: Image) -> None:
        """Write the next rows; the first ones say what the channels and metadata are."""
        planes = exr_planes(rows)
        try:
            if self._file is None:
                self._file = self._begin(rows, list(planes))
            content = {name: plane.tobytes() for name, plane in planes.items()}
            self._file.writePixels(content, rows.height)
        except (OSError, RuntimeError) as error:
            raise SceneError(f"{self._path}: cannot be written: {error}") from error

    def _close(self) -> None:
        try:
            if self._file is not None:
                self._file.close()
        except (OSError, RuntimeError) as error:
            raise SceneError(f"{self._path}: cannot be written: {error}") from error

    def _begin(self, rows: Image, names: list[str]) -> Any:
        import Imath  # comes with OpenEXR; both here, as they take 0.1 s
        import OpenEXR

        header = OpenEXR.Header(*self._size)
        single = Imath.PixelType(Imath.PixelType.FLOAT)
        header["channels"] = {name: Imath.Channel(single) for name in names}
        header["compression"] = Imath.Compression(Imath.Compression.ZIP_COMPRESSION)
        header["type"] = b"scanlineimage"
        header["spp"] = int(rows.spp)
        header.update({key: str(text).encode() for key, text in rows.metadata.items()})
        return OpenEXR.OutputFile(str(self._temporary), header)
