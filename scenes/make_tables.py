"""Make the measured material in this folder: `python scenes/make_tables.py`.

It is measured from a model, as real measurements may not be passed on: a rough conductor
(GGX, alpha 0.2), which is Cook and Torrance's formula in half and difference angles.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.plugins.bsdfs.merl_file import cell_centres, write_merl

HERE = Path(__file__).parent
CELLS = (24, 20, 32)
BRONZE = np.array([0.8, 0.55, 0.3])
ALPHA = 0.2


def rough_conductor(
    theta_h: NDArray[np.float64], theta_d: NDArray[np.float64], phi_d: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return f [1/sr] of a metal that reflects everything; 0 below the horizon."""
    sin_h, cos_h = np.sin(theta_h), np.cos(theta_h)
    sin_d, cos_d = np.sin(theta_d), np.cos(theta_d)
    # z of the two directions: half vector turned up by theta_h, around y
    swing = sin_h * sin_d * np.cos(phi_d)
    cos_i, cos_o = cos_h * cos_d - swing, cos_h * cos_d + swing
    d = ALPHA**2 / (np.pi * (cos_h**2 * (ALPHA**2 - 1) + 1) ** 2)

    def g1(cosine: NDArray[np.float64]) -> NDArray[np.float64]:
        above = np.maximum(cosine, 1e-3)
        tangent = (1 - above**2) / above**2
        return 2 / (1 + np.sqrt(1 + ALPHA**2 * tangent))

    f = d * g1(cos_i) * g1(cos_o) / (4 * np.maximum(cos_i * cos_o, 1e-3))
    return np.asarray(np.where((cos_i > 0) & (cos_o > 0), f, 0.0))


def main(folder: Path = HERE) -> None:
    """Write every table of every scene under `folder`."""
    f = BRONZE[:, None, None, None] * rough_conductor(*cell_centres(CELLS))
    path = folder / "measured-ball/measured/bronze.binary"
    path.parent.mkdir(parents=True, exist_ok=True)
    write_merl(path, f)


if __name__ == "__main__":
    main()
