"""Write renderer/plugins/lights/sunsky.npz from the tables that Mitsuba's wheel carries.

`python docs/make_sunsky_tables.py`, where Mitsuba 3.9.1 is installed. The tables are those
of Hosek and Wilkie under a BSD licence, which is copied next to the file. Of their spectra
this renderer needs three colours and the luminance, so these are taken here.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))  # of this clone, whatever is installed

from renderer.plugins.bsdfs.tensor_file import TensorFile  # noqa: E402
from renderer.scene_file.colors.spectra import OBSERVER, WAVELENGTHS  # noqa: E402
from renderer.scene_file.images.image import SRGB_FROM_XYZ  # noqa: E402

TABLES = ROOT / "renderer" / "plugins" / "lights" / "sunsky.npz"
LICENSE = TABLES.with_name("sunsky_license.txt")
BANDS = np.linspace(320.0, 720.0, 11)  # [nm] of the spectra


def source() -> Path:
    """Return the folder of the tables in the installed Mitsuba."""
    found = importlib.util.find_spec("mitsuba")
    assert found is not None and found.origin is not None
    return Path(found.origin).parent / "data" / "sunsky"


def read_tensors(path: Path) -> dict[str, NDArray[Any]]:
    """Return the arrays of a file."""
    with path.open("rb") as file:
        tensors = TensorFile(path, file)
        return {name: tensors.read(name) for name in tensors.fields}


def make_tables() -> dict[str, NDArray[np.float32]]:
    """Return what `sky_model.tables` says of each."""
    model = read_tensors(source() / "sunsky_datasets.bin")
    sampling = read_tensors(source() / "sampling_data.bin")
    observer = np.stack(  # 0 below 360 nm
        [np.interp(BANDS, WAVELENGTHS, bar, left=0.0) for bar in OBSERVER.T], axis=1
    )
    sun, sky = (sampling[f"{name}_irradiance"].astype(float) for name in ("sun", "sky"))
    xyz = sun @ observer / len(BANDS)
    tables = {
        "sky_parameters": model["sky_params_rgb"].reshape(10, 2, 6, 3, 9),
        "sky_radiance": model["sky_rad_rgb"].reshape(10, 2, 6, 3),
        "sun_radiance": model["sun_rad_rgb"].reshape(10, 45, 3, 4, 6),
        "sky_power": sky @ observer[:, 1] / len(BANDS),
        "sun_power": xyz[..., 1],
        "sun_rgb": xyz @ SRGB_FROM_XYZ.T,
        "warp": np.swapaxes(sampling["weights"], 0, 1),
    }
    return {name: table.astype(np.float32) for name, table in tables.items()}


if __name__ == "__main__":
    np.savez_compressed(TABLES, **make_tables())  # type: ignore[arg-type]
    text = (source() / "LICENSE").read_text(encoding="utf-8")
    lines = (line.rstrip() for line in text.splitlines())
    LICENSE.write_text("\n".join(lines).strip() + "\n", encoding="utf-8")
