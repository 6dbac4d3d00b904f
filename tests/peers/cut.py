"""Cuts a ball by planes with ours and with manifold3d, in turn, and prints a line of JSON for each size.

    pip install manifold3d numpy
    cargo bench -p render --bench cut --no-run
    python tests/peers/cut.py target/release/deps/cut-*

The argument is the program that the second line builds; it keeps the mesh in memory and cuts by every plane that it is
given. Least times count; the worst relative defect of the parts' volumes of all planes is beside them. What manifold3d
keeps for later is asked for within its time: the parts' counts of triangles.
"""

import json
import math
import random
import subprocess
import sys
import tempfile
import time

import manifold3d
import numpy

ROUNDS = 15


def volume(mesh):
    """Enclosed volume about the origin, summed without loss."""
    corners = numpy.asarray(mesh.vert_properties)[:, :3][numpy.asarray(mesh.tri_verts)]
    terms = numpy.einsum("ij,ij->i", corners[:, 0], numpy.cross(corners[:, 1], corners[:, 2])) / 6
    return math.fsum(terms)


def write(file, mesh):
    places = numpy.ascontiguousarray(numpy.asarray(mesh.vert_properties)[:, :3], "<f8")
    corners = numpy.ascontiguousarray(mesh.tri_verts, "<u4")
    file.write(numpy.array([len(places), len(corners)], "<u8").tobytes())
    file.write(places.tobytes())
    file.write(corners.tobytes())
    file.flush()


def main():
    program = sys.argv[1]
    dice = random.Random(1)
    for segments in (512, 1024):
        whole = manifold3d.Manifold.sphere(50.0, segments)
        mesh = whole.to_mesh64()
        true = volume(mesh)
        with tempfile.NamedTemporaryFile() as file:
            write(file, mesh)
            pipe = subprocess.PIPE
            ours = subprocess.Popen([program, file.name], stdin=pipe, stdout=pipe, text=True)
            times, defects = {"ours": [], "manifold3d": []}, {"ours": [], "manifold3d": []}
            for _ in range(ROUNDS):
                normal = [dice.gauss(0, 1) for _ in range(3)]
                length = math.hypot(*normal)
                normal = [n / length for n in normal]
                offset = dice.uniform(-20, 20)
                point = [n * offset for n in normal]
                print(*point, *normal, file=ours.stdin, flush=True)
                answer = json.loads(ours.stdout.readline())
                times["ours"].append(answer["secs"])
                defects["ours"].append(answer["defect"])
                start = time.perf_counter()
                parts = whole.split_by_plane(normal, offset)
                counts = [part.num_tri() for part in parts]
                times["manifold3d"].append(time.perf_counter() - start)
                assert min(counts) > 0
                volumes = [volume(part.to_mesh64()) for part in parts]
                defects["manifold3d"].append(abs(math.fsum([*volumes, -true])) / true)
            ours.stdin.close()
            ours.wait()
        least = {name: min(values) for name, values in times.items()}
        print(
            json.dumps(
                {
                    "triangles": whole.num_tri(),
                    "ms": {name: round(1e3 * secs, 2) for name, secs in least.items()},
                    "worst_ms": {name: round(1e3 * max(values), 2) for name, values in times.items()},
                    "times_as_fast": round(least["manifold3d"] / least["ours"], 1),
                    "worst_defect": {name: max(values) for name, values in defects.items()},
                }
            )
        )


main()
