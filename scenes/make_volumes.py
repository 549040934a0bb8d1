"""Make the smoke in this folder: `python scenes/make_volumes.py`."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

HERE = Path(__file__).parent
SIZE = 28


def smoke(size: int = SIZE, seed: int = 3) -> NDArray[np.float32]:
    """Return a plume that rises and curls, (z, y, x), in [0, 1]; y is up."""
    axis = (np.arange(size) + 0.5) / size
    z, y, x = np.meshgrid(axis, axis, axis, indexing="ij")
    rng = np.random.default_rng(seed)
    noise = np.zeros_like(x)
    for octave in range(4):  # sums of waves in random directions
        for _ in range(6):
            wave = rng.normal(size=3) * 2.5 * 2.0**octave
            phase = rng.uniform(0.0, 2.0 * np.pi)
            noise += np.sin(wave[0] * x + wave[1] * y + wave[2] * z + phase) / 2.0**octave
    noise /= np.abs(noise).max()
    centre = 0.5 + 0.12 * np.sin(5.0 * y), 0.5 + 0.1 * np.cos(4.0 * y)
    radius = np.hypot(x - centre[0], z - centre[1]) / (0.12 + 0.28 * y)
    plume = np.clip(1.15 - radius + 0.55 * noise, 0.0, 1.0)
    edge = np.minimum.reduce([x, 1.0 - x, z, 1.0 - z, y + 0.05, 1.05 - y])
    return (plume * np.clip(edge * 12.0, 0.0, 1.0)).astype(np.float32)


def main(folder: Path = HERE) -> None:
    """Write every volume of every scene under `folder`."""
    values = smoke()
    counts = values.shape[::-1]
    header = struct.pack("<3sB5i6f", b"VOL", 3, 1, *counts, 1, 0, 0, 0, 1, 1, 1)
    path = folder / "mist/volumes/smoke.vol"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(header + values.astype("<f4").tobytes())


if __name__ == "__main__":
    main()
