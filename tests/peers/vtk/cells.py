"""Draws an unstructured grid with VTK and says how long a frame took: the peer that our projection of cells stands beside.

The input is a scene file, as `osteotome bench cells --peer` writes it, so that both draw the same tetrahedra, scalar,
transfer function and view:

    {"grid": "femur_fe_stress.vtu", "place": "points", "field": "von_mises_MPa", "component": 0,
     "camera": {"eye": [..], "target": [..], "up": [..], "parallel_mm": 210}, "transfer": {"unit_mm": 1, "points": [..]}}

`component` may be left out: then the length of a vector is shown. Camera and transfer function are those of a case.

    python cells.py SCENE --mapper rays --frames 5 --out picture.npy
    python cells.py SCENE --mapper tetrahedra --serve

Mappers: `rays` is `vtkUnstructuredGridVolumeRayCastMapper` (Bunyk), `tetrahedra` is `vtkProjectedTetrahedraMapper`, `sweep`
is `vtkUnstructuredGridVolumeZSweepMapper`. `--out` and `--serve` are those of `volume.py`.

What a mapper keeps from frame to frame (faces and their neighbours, colours of points, tables of integrals) is made in
the frames that are not counted. The picture is that of the window, 8 bits a channel: no mapper of these gives out more.
"""

import argparse
import json
from pathlib import Path

import numpy as np
import volume
import vtk
from vtkmodules.util import numpy_support

MAPPERS = {
    "rays": vtk.vtkUnstructuredGridVolumeRayCastMapper,
    "tetrahedra": vtk.vtkProjectedTetrahedraMapper,
    "sweep": vtk.vtkUnstructuredGridVolumeZSweepMapper,
}


def read(path):
    """A grid of the two kinds of files that VTK writes itself."""
    if path.suffix == ".vtu":
        reader = vtk.vtkXMLUnstructuredGridReader()
    elif path.suffix == ".vtk":
        reader = vtk.vtkUnstructuredGridReader()
        reader.ReadAllScalarsOn()
    else:
        volume.refuse(f"a .vtu or .vtk file is needed; choose another grid: {path}")
    reader.SetFileName(str(path))
    reader.Update()
    grid = reader.GetOutput()
    if grid.GetNumberOfCells() == 0:
        volume.refuse(f"there is no cell in it; choose another grid: {path}")
    return grid


def tetrahedra(grid):
    """The same grid where it is of tetrahedra alone, else its cells cut: no mapper of these draws others."""
    kinds = vtk.vtkCellTypes()
    grid.GetDistinctCellTypes(kinds)
    if all(kinds.GetCellType(i) == vtk.VTK_TETRA for i in range(kinds.GetNumberOfTypes())):
        return grid
    cut = vtk.vtkDataSetTriangleFilter()
    cut.TetrahedraOnlyOn()
    cut.SetInputData(grid)
    cut.Update()
    return cut.GetOutput()


def mapper_of(name, threads):
    """A mapper with nothing left to its own judgement but how it integrates."""
    mapper = MAPPERS[name]()
    if name != "tetrahedra":
        mapper.SetAutoAdjustSampleDistances(0)
        mapper.SetImageSampleDistance(1.0)
    if name == "rays":
        mapper.SetNumberOfThreads(threads)
    return mapper


def scalar(grid, scene):
    """The scalar that the scene shows as the grid's own, and which of the mappers' modes finds it."""
    of_points = scene["place"] == "points"
    data = grid.GetPointData() if of_points else grid.GetCellData()
    field = data.GetArray(scene["field"])
    if field is None:
        volume.refuse(f"the grid has no field \"{scene['field']}\" on its {scene['place']}; choose another grid")
    tuples = numpy_support.vtk_to_numpy(field).reshape(field.GetNumberOfTuples(), -1)
    component = scene.get("component")
    values = np.linalg.norm(tuples, axis=1) if component is None else tuples[:, component]
    data.SetScalars(numpy_support.numpy_to_vtk(np.ascontiguousarray(values, np.float64), deep=True))
    return vtk.VTK_SCALAR_MODE_USE_POINT_DATA if of_points else vtk.VTK_SCALAR_MODE_USE_CELL_DATA


class Peer(volume.Window):
    """A window with the grid of a scene."""

    def __init__(self, args):
        scene = json.loads(args.case.read_text())
        grid = tetrahedra(read(args.case.parent / scene["grid"]))
        mapper = mapper_of(args.mapper, args.threads)
        mapper.SetScalarMode(scalar(grid, scene))
        super().__init__(mapper, grid, scene["transfer"], args.size)
        self.aim(scene["camera"])

    def write(self, path, _floats):
        """Writes the picture to a `.npy` file."""
        np.save(path, self.picture())


def main():
    """A scene's grid."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("case", metavar="SCENE", type=Path)
    parser.add_argument("--mapper", choices=sorted(MAPPERS), default="rays")
    args = volume.arguments(parser)
    peer = Peer(args)
    volume.run(peer, args, {"tetrahedra": peer.mapper.GetInput().GetNumberOfCells()})


if __name__ == "__main__":
    main()
