"""Peak signal-to-noise ratio of pictures against the reference, over black: `compare.py REFERENCE.exr PICTURE.npy...`.

Pictures are `.npy` (what `volume.py` writes) or `.exr` (what `osteotome render` writes), float RGBA, premultiplied.
Prints a JSON object for each. `psnr_db` is that of `osteotome bench`: red, green and blue, peak 255, not rounded.

VTK ends a volume at the outermost voxel centres, where ours keeps the edge sample for half a voxel more: compare on a
volume of `border.py`. `--inside FILE.exr` names the reference of the same view of the volume as it is; pixels where the
two references differ, that is where the rim was seen, are then left out of `psnr_inside_db`.
"""

import argparse
import json
from pathlib import Path

import numpy as np


def picture_of(path):
    """Float64 RGB over black, rows from the top, and opacity."""
    if path.suffix == ".npy":
        return np.load(path).astype(np.float64)
    import OpenEXR

    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = file.channels()
        return np.stack([channels[c].pixels for c in "RGBA"], axis=-1).astype(np.float64)


def psnr(a, b):
    """Decibels, or None where nothing differs."""
    square = np.mean((a - b) ** 2)
    return None if square == 0 else float(10 * np.log10(1 / square))


def main():
    """Compares."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("reference", type=Path)
    parser.add_argument("pictures", type=Path, nargs="+")
    parser.add_argument("--inside", type=Path)
    args = parser.parse_args()
    truth = picture_of(args.reference)[..., :3]
    inside = np.ones(truth.shape[:2], bool)
    if args.inside:
        inside = np.abs(picture_of(args.inside)[..., :3] - truth).max(axis=-1) < 1e-6
    for path in args.pictures:
        picture = picture_of(path)[..., :3]
        apart = np.abs(picture - truth).max(axis=-1) * 255
        row = {"picture": path.name, "psnr_db": psnr(picture, truth), "max_error_255": float(apart.max())}
        if args.inside:
            row |= {"pixels_inside": float(inside.mean()), "psnr_inside_db": psnr(picture[inside], truth[inside])}
            row |= {"max_error_inside_255": float(apart[inside].max())}
        print(json.dumps(row))


if __name__ == "__main__":
    main()
