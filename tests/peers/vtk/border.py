"""Writes a volume whose outermost voxels are air, and cases that show it: `border.py CT.nrrd FOLDER`.

VTK ends a volume at its outermost voxel centres; ours goes half a voxel further, as contract and texture hardware do.
With air there the two see the same, so that a comparison is of rendering and not of where a volume ends.

FOLDER gets `bordered.nrrd` and, each for the volume as it is and with the border, a case for bone and one for soft
tissue: `bone.json`, `bone_bordered.json`, `soft.json`, `soft_bordered.json`.
"""

import argparse
import json
from pathlib import Path

import nrrd
import numpy as np
from volume import nrrd_volume

AIR = -1024
BONE = [[-1024, 0, 0, 0, 0], [150, 0.9, 0.6, 0.4, 0], [300, 0.9, 0.7, 0.5, 0.05]]
BONE += [[700, 1, 0.95, 0.85, 0.5], [3000, 1, 1, 1, 0.8]]
SOFT = [[-1024, 0.8, 0.5, 0.4, 0], [-300, 0.8, 0.5, 0.4, 0], [-50, 0.9, 0.7, 0.5, 0.01]]
SOFT += [[40, 0.9, 0.45, 0.35, 0.03], [120, 0.8, 0.3, 0.25, 0.06], [300, 1, 0.9, 0.8, 0.1], [3000, 1, 1, 1, 0.3]]
FROM = np.array([0.45, -0.85, 0.28])  # towards the eye: from the left, the front and above


def camera(shape, matrix):
    """Looks at the middle from outside, with all of the volume's ball in the picture."""
    ends = [matrix @ np.array([*corner, 1.0]) for corner in (np.zeros(3), np.array(shape) - 1.0)]
    middle = (ends[0] + ends[1])[:3] / 2
    radius = np.linalg.norm((ends[1] - ends[0])[:3]) / 2
    eye = middle + FROM / np.linalg.norm(FROM) * radius * 3.4
    return {"eye": eye.tolist(), "target": middle.tolist(), "up": [0, 0, 1], "fov_deg": 30}


def main():
    """Writes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("ct", type=Path)
    parser.add_argument("folder", type=Path)
    args = parser.parse_args()
    args.folder.mkdir(parents=True, exist_ok=True)
    samples, header = nrrd.read(str(args.ct), index_order="F")
    bordered = np.full_like(samples, AIR)
    bordered[1:-1, 1:-1, 1:-1] = samples[1:-1, 1:-1, 1:-1]
    nrrd.write(str(args.folder / "bordered.nrrd"), bordered, header, index_order="F")
    view = camera(samples.shape, nrrd_volume(args.ct)[1])
    for name, points in (("bone", BONE), ("soft", SOFT)):
        for suffix, source in (("", str(args.ct.resolve())), ("_bordered", "bordered.nrrd")):
            volume = {"id": "ct", "source": source, "shading": "none"}
            volume["transfer"] = {"points": points, "unit_mm": 1.0}
            case = {"osteotome": 1, "name": name, "volumes": [volume], "camera": view, "background": [0, 0, 0]}
            (args.folder / f"{name}{suffix}.json").write_text(json.dumps(case, indent=1) + "\n")


if __name__ == "__main__":
    main()
