"""Draws a case's one volume with VTK and says how long a frame took: the peer that our renderers stand beside.

The input is a case file, the one that `osteotome` reads, so that both draw the same volume, transfer function and
camera. What a case can say and VTK cannot draw alike (fragments, implants, shading, other projections' details) is
refused, not approximated in silence.

    python volume.py CASE --mapper gpu --step 0.5 --frames 7 --out picture.npy
    python volume.py CASE --mapper fixed --step 0.5 --serve

`--step` is the sample distance in voxels of the smallest spacing. `--out` writes the picture as float32 RGBA,
premultiplied, over black, rows from the top. With `--serve` the program answers each line `render` on standard input
by the milliseconds of one frame, a line `write FILE` by `ok`, and ends with its input: a driver can then let two
renderers take turns. Otherwise one JSON object is printed.

Set alike on both sides: post-classification, linear interpolation, no shading, opacity per `unit_mm`, a fixed sample
distance, no jitter, no adjustment of distances, as many pixels as rays, black background.
"""

import argparse
import ctypes
import json
import sys
import time
from pathlib import Path

import numpy as np
import vtk
from vtkmodules.util import numpy_support

WARM_FRAMES = 2


def refuse(fault):
    """Ends with a sentence that names fault and remedy."""
    sys.exit(f"volume.py: {fault}")


def nrrd_volume(path):
    """Samples as `[x, y, z]` and `world_from_voxel` in LPS mm."""
    import nrrd

    samples, header = nrrd.read(str(path), index_order="F")
    space = header.get("space", "left-posterior-superior").lower()
    names = {"l": 1, "r": -1, "p": 1, "a": -1, "s": 1, "i": -1}
    letters = space if len(space) == 3 else "".join(word[0] for word in space.split("-"))
    signs = np.array([names[letter] for letter in letters], float)
    matrix = np.eye(4)
    matrix[:3, :3] = (np.asarray(header["space directions"], float) * signs).T
    matrix[:3, 3] = np.asarray(header.get("space origin", np.zeros(3)), float) * signs
    return samples, matrix


def nifti_volume(path):
    """Samples as `[x, y, z]` and `world_from_voxel` in LPS mm."""
    import nibabel

    image = nibabel.load(path)
    return np.asanyarray(image.dataobj), np.diag([-1.0, -1.0, 1.0, 1.0]) @ image.affine


def volume_of(path):
    """The samples in the type that VTK is given them in, and where they are."""
    reader = nrrd_volume if path.suffix in (".nrrd", ".nhdr") else nifti_volume
    samples, matrix = reader(path)
    if samples.ndim != 3:
        refuse(f"a volume of three axes is needed; choose another source: {path}")
    whole = np.array_equal(samples, np.rint(samples)) and np.abs(samples).max() < 32768
    return samples.astype(np.int16 if whole else np.float32), matrix


def image_data(samples, matrix):
    """An image with its spacing, and the right-handed rigid matrix that places it: axes that would mirror are turned."""
    linear = matrix[:3, :3]
    spacing = np.linalg.norm(linear, axis=0)
    rotation = linear / spacing
    if np.abs(rotation.T @ rotation - np.eye(3)).max() > 1e-5:
        refuse("the volume's axes are not perpendicular, which VTK's mappers do not draw; choose another source")
    place = np.eye(4)
    place[:3, 3] = matrix[:3, 3]
    if np.linalg.det(rotation) < 0:
        axis = int(np.argmin(rotation.diagonal()))
        place[:3, 3] += linear[:, axis] * (samples.shape[axis] - 1)
        rotation[:, axis] *= -1
        samples = np.flip(samples, axis)
    place[:3, :3] = rotation
    image = vtk.vtkImageData()
    image.SetDimensions(samples.shape)
    image.SetSpacing(*spacing)
    flat = numpy_support.numpy_to_vtk(np.ascontiguousarray(samples.ravel(order="F")), deep=True)
    image.GetPointData().SetScalars(flat)
    return image, place, spacing.min()


def vtk_matrix(matrix):
    """The same as VTK's type."""
    out = vtk.vtkMatrix4x4()
    out.DeepCopy(np.asarray(matrix, float).ravel())
    return out


def properties(transfer):
    """Colour and opacity, piecewise linear and held constant outside; two points of one value make a jump."""
    color, opacity = vtk.vtkColorTransferFunction(), vtk.vtkPiecewiseFunction()
    color.SetColorSpaceToRGB()
    color.ClampingOn()
    opacity.ClampingOn()
    color.AllowDuplicateScalarsOn()
    opacity.AllowDuplicateScalarsOn()
    for value, red, green, blue, alpha in transfer["points"]:
        color.AddRGBPoint(value, red, green, blue)
        opacity.AddPoint(value, alpha)
    out = vtk.vtkVolumeProperty()
    out.SetColor(color)
    out.SetScalarOpacity(opacity)
    out.SetScalarOpacityUnitDistance(transfer.get("unit_mm", 1.0))
    out.SetInterpolationTypeToLinear()
    out.ShadeOff()
    return out


def mapper_of(name, step_mm, threads):
    """A mapper with nothing left to its own judgement."""
    if name == "gpu":
        mapper = vtk.vtkOpenGLGPUVolumeRayCastMapper()
        mapper.SetUseJittering(0)
    else:
        mapper = vtk.vtkFixedPointVolumeRayCastMapper()
        mapper.SetNumberOfThreads(threads)
        mapper.SetInteractiveSampleDistance(step_mm)
    mapper.SetLockSampleDistanceToInputSpacing(0)
    mapper.SetAutoAdjustSampleDistances(0)
    mapper.SetImageSampleDistance(1.0)
    mapper.SetSampleDistance(step_mm)
    mapper.SetBlendModeToComposite()
    return mapper


class Window:
    """A window of VTK's own, off screen, with one volume in it."""

    def __init__(self, mapper, data, transfer, size):
        self.mapper = mapper
        mapper.SetInputData(data)
        self.actor = vtk.vtkVolume()
        self.actor.SetMapper(mapper)
        self.actor.SetProperty(properties(transfer))
        self.renderer = vtk.vtkRenderer()
        self.renderer.SetBackground(0, 0, 0)
        self.renderer.AddVolume(self.actor)
        self.window = vtk.vtkRenderWindow()
        self.window.SetOffScreenRendering(1)
        self.window.SetMultiSamples(0)
        self.window.SetAlphaBitPlanes(1)
        self.window.SetSize(*size)
        self.window.AddRenderer(self.renderer)

    def aim(self, camera):
        """Sets the view; the clipping range holds the whole volume and does not move."""
        view = self.renderer.GetActiveCamera()
        view.SetPosition(*camera["eye"])
        view.SetFocalPoint(*camera["target"])
        view.SetViewUp(*camera.get("up", [0, 0, 1]))
        if "parallel_mm" in camera:
            view.ParallelProjectionOn()
            view.SetParallelScale(camera["parallel_mm"] / 2)
        else:
            view.SetViewAngle(camera.get("fov_deg", 30))
        self.renderer.ResetCameraClippingRange()

    def frame_ms(self):
        """Draws a whole frame, waits until it is drawn, and returns the milliseconds."""
        self.renderer.Modified()
        begin = time.perf_counter()
        self.window.Render()
        self.window.WaitForCompletion()
        return (time.perf_counter() - begin) * 1e3

    def picture(self):
        """RGBA as drawn last, float32, rows from the top; of 8 bits, as many as the window holds."""
        grab = vtk.vtkUnsignedCharArray()
        width, height = self.window.GetSize()
        self.window.GetRGBACharPixelData(0, 0, width - 1, height - 1, 0, grab)
        pixels = numpy_support.vtk_to_numpy(grab).reshape(height, width, 4)
        return (pixels[::-1] / np.float32(255)).astype(np.float32)


class Peer(Window):
    """A window with the volume of a case."""

    def __init__(self, args):
        case = json.loads(args.case.read_text())
        shown = [v for v in case["volumes"] if v.get("visible", True)]
        if len(shown) != 1 or case.get("fragments") or case.get("implants"):
            refuse("a case of one volume without fragments and implants is needed")
        volume = shown[0]
        if volume.get("shading", "none") != "none":
            refuse("the volume is shaded; set its shading to none")
        samples, matrix = volume_of(args.case.parent / volume["source"])
        pose = np.array(volume.get("pose", np.eye(4).ravel()), float).reshape(4, 4)
        image, place, finest = image_data(samples, pose @ matrix)
        self.step_mm = finest * args.step
        mapper = mapper_of(args.mapper, self.step_mm, args.threads)
        super().__init__(mapper, image, volume["transfer"], args.size)
        self.actor.SetUserMatrix(vtk_matrix(place))
        self.aim(case["camera"])

    def frame_ms(self):
        """The same, with nothing kept from the frame before."""
        self.mapper.Modified()
        return super().frame_ms()

    def float_picture(self):
        """The same drawn once more through a float target, so that 8 bits hide nothing."""
        # The mapper ends its rays at the depth buffer, which a target of its own does not clear.
        clear_depth, clear_color = vtk.vtkClearZPass(), vtk.vtkClearRGBPass()
        clear_depth.SetDepth(1.0)
        clear_color.SetBackground(0, 0, 0)
        passes = vtk.vtkRenderPassCollection()
        for each in (clear_depth, clear_color, vtk.vtkVolumetricPass()):
            passes.AddItem(each)
        sequence = vtk.vtkSequencePass()
        sequence.SetPasses(passes)
        target = vtk.vtkFramebufferPass()
        target.SetColorFormat(vtk.vtkTextureObject.Float32)
        target.SetDelegatePass(sequence)
        camera = vtk.vtkCameraPass()
        camera.SetDelegatePass(target)
        self.renderer.SetPass(camera)
        self.window.Render()
        texture = target.GetColorTexture()
        pixels = texture.Download()
        width, height = texture.GetWidth(), texture.GetHeight()
        out = np.zeros((height, width, texture.GetComponents()), np.float32)
        done = pixels.Download2D(vtk.VTK_FLOAT, out, [width, height], out.shape[2], [0, 0])
        self.renderer.SetPass(None)
        camera.ReleaseGraphicsResources(self.window)
        if not done:
            refuse("the float target could not be read; leave out --float")
        return out[::-1]

    def ray_picture(self):
        """What the fixed-point mapper's rays found, 15 bits a channel, before its display draws them a little enlarged.

        The display lays the rays' picture over the window with an error of up to half a pixel in its size, which blurs
        edges. That is VTK's own, and in the window's picture; the rays are looked at too, so that a comparison of
        integrals is not one of displays.
        """
        rays = self.mapper.GetRayCastImage()
        (row, rows), (width, height) = rays.GetImageMemorySize(), rays.GetImageInUseSize()
        address = int(rays.GetImage().strip("_").split("_")[0], 16)
        words = np.ctypeslib.as_array((ctypes.c_uint16 * (row * rows * 4)).from_address(address))
        out = np.zeros((*rays.GetImageViewportSize()[::-1], 4), np.float32)
        left, low = rays.GetImageOrigin()
        seen = words.reshape(rows, row, 4)[:height, :width]
        out[low : low + height, left : left + width] = seen / np.float32(32767)
        return out[::-1]

    def write(self, path, floats):
        """Writes the picture to a `.npy` file; with `floats` from before it is rounded to the window's 8 bits."""
        if not floats:
            np.save(path, self.picture())
        elif self.mapper.IsA("vtkFixedPointVolumeRayCastMapper"):
            np.save(path, self.ray_picture())
        else:
            np.save(path, self.float_picture())


def arguments(parser):
    """What can be asked for of any peer here."""
    parser.add_argument("--size", type=lambda text: [int(n) for n in text.split("x")], default=[512, 512])
    parser.add_argument("--threads", type=int, default=2, help="of mappers that have threads of their own")
    parser.add_argument("--frames", type=int, default=7)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--float", action="store_true", help="the picture before it is rounded to the window's 8 bits")
    parser.add_argument("--serve", action="store_true")
    return parser.parse_args()


def run(peer, args, report):
    """Draws, by the line or at once; then `report` is printed with the times."""
    for _ in range(WARM_FRAMES):
        peer.frame_ms()
    if args.serve:
        print("ready", flush=True)
        for line in sys.stdin:
            command, _, rest = line.strip().partition(" ")
            if command == "render":
                print(peer.frame_ms(), flush=True)
            elif command == "write":
                peer.write(rest, args.float)
                print("ok", flush=True)
            else:
                refuse(f"`{command}` is no command; send `render` or `write FILE`")
        return
    times = sorted(peer.frame_ms() for _ in range(args.frames))
    if args.out:
        peer.write(args.out, args.float)
    report = {"peer": f"vtk {vtk.vtkVersion().GetVTKVersion()}", "mapper": args.mapper} | report
    report |= {"size": args.size, "frames": len(times)}
    print(json.dumps(report | {"min_ms": times[0], "median_ms": times[len(times) // 2]}))


def main():
    """A case's volume."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("case", type=Path)
    parser.add_argument("--mapper", choices=["gpu", "fixed"], default="gpu")
    parser.add_argument("--step", type=float, default=1.0, help="sample distance; voxels of the smallest spacing")
    args = arguments(parser)
    peer = Peer(args)
    run(peer, args, {"step_voxels": args.step, "step_mm": peer.step_mm})


if __name__ == "__main__":
    main()
