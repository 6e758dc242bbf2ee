"""Reading surface files beside the libraries that read them: processor time and peak of memory, each in a process."""

import importlib.util
import json
import subprocess
import sys

import numpy as np
import pytest

from voxkernel.mesh.files import write_triangles

SIDE = 708  # a million facets
READERS = {
    "voxkernel, polygons": "from voxkernel.mesh.files import read_polygons as read",
    "voxkernel, as_mesh": "from voxkernel import as_mesh as read",
    "open3d": "import open3d; read = open3d.io.read_triangle_mesh",
    "trimesh": "import trimesh; read = lambda path: trimesh.load(path, process=False)",
    "pyvista": "import pyvista; read = pyvista.read",
    "meshio": "import meshio; read = meshio.read",
}
# The peak is that of /proc: what `resource` says of a child includes its parent before it started.
CODE = """
{reader}
import json, re, sys, time
peak = lambda: 1024 * int(re.search(r"VmHWM:\\s+(\\d+)", open("/proc/self/status").read())[1])
before, start = peak(), time.process_time()
found = read(sys.argv[1])
taken = time.process_time() - start
print(json.dumps([taken, peak() - before]))
"""


def rows(pattern, table):
    return "".join(pattern % tuple(row) for row in table.tolist())


def write(folder, name):
    i, j = np.meshgrid(np.arange(SIDE), np.arange(SIDE), indexing="ij")
    u, v = i / (SIDE - 1), j / (SIDE - 1)
    points = np.stack([u, v, np.sin(7 * u) * np.cos(9 * v)], axis=-1).reshape(-1, 3) + 1 / 3
    corner = (i[:-1, :-1] * SIDE + j[:-1, :-1]).reshape(-1)
    quads = np.stack([corner, corner + SIDE, corner + SIDE + 1, corner + 1], axis=1)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    path = folder / name
    head = f"element vertex {len(points)}\nproperty double x\nproperty double y\nproperty double z\nelement face {{}}\n"
    head += "property list uchar int vertex_indices\nend_header\n"
    if name == "ascii.ply":
        body = rows("%.17g %.17g %.17g\n", points) + rows("3 %d %d %d\n", faces)
        path.write_text("ply\nformat ascii 1.0\n" + head.format(len(faces)) + body)
    elif name == "text.stl":
        corners = rows("facet normal 0 0 1\nouter loop\n" + 3 * "vertex %.9g %.9g %.9g\n" + "endloop\nendfacet\n",
                       points[faces].reshape(-1, 9))  # fmt: skip
        path.write_text("solid a\n" + corners + "endsolid a\n")
    elif name == "mixed.ply":
        parts = []
        for ids in (faces[: len(faces) // 2], quads[len(quads) // 2 :]):
            table = np.empty(len(ids), dtype=[("n", "u1"), ("ids", "<i4", (ids.shape[1],))])
            table["n"], table["ids"] = ids.shape[1], ids
            parts.append(table.tobytes())
        n = len(faces) // 2 + len(quads) - len(quads) // 2
        head = "ply\nformat binary_little_endian 1.0\n" + head.format(n)
        path.write_bytes(head.encode() + points.astype("<f8").tobytes() + b"".join(parts))
    else:
        write_triangles(path, points, faces)
    return path, len(faces)


@pytest.mark.parametrize("name", ["a.obj", "ascii.ply", "text.stl", "mixed.ply", "a.off", "a.ply", "a.stl"])
def test_reading(name, tmp_path):
    path, n = write(tmp_path, name)
    for reader, line in READERS.items():
        package = reader.split(",")[0]
        if importlib.util.find_spec(package) is None:
            print(f"{name:10} {reader:20} not installed")
            continue
        best = []
        for _ in range(3):
            words = [sys.executable, "-c", CODE.format(reader=line), str(path)]
            done = subprocess.run(words, capture_output=True, text=True)
            if done.returncode:
                break
            best.append(json.loads(done.stdout.splitlines()[-1]))
        if best:
            seconds, peak = np.min(best, axis=0)
            print(f"{name:10} {reader:20} {seconds:7.3f} s of processor time  {peak / n:7.0f} bytes a facet")
        else:
            print(f"{name:10} {reader:20} cannot read it: {done.stderr.splitlines()[-1][:80]}")
