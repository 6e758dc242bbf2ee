"""Facts of a surface: processor time, and memory at its peak beyond the surface; Linux only.

python tests/benchmarks/facts_and_memory.py KIND FACETS prints one line. Kinds: a torus in the order of its rings; the
same `shuffled`; with a tenth of its facets gone, `holes`; as a `soup` that shares no vertex.
"""

import re
import sys
import time
from pathlib import Path

import numpy as np

from voxkernel.mesh.facts import mesh_facts

STATUS, RESET = Path("/proc/self/status"), Path("/proc/self/clear_refs")


def torus(n_faces):
    n_major = int(np.sqrt(n_faces / 2))
    n_minor = n_faces // (2 * n_major)
    i, j = (k.reshape(-1) for k in np.meshgrid(np.arange(n_major), np.arange(n_minor), indexing="ij"))
    u, v = 2 * np.pi * i / n_major, 2 * np.pi * j / n_minor
    radius = 2 + 0.5 * np.cos(v)
    vertices = np.stack([radius * np.cos(u), radius * np.sin(u), 0.5 * np.sin(v)], axis=1)
    corners = [(i + a) % n_major * n_minor + (j + b) % n_minor for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
    return vertices, np.stack([corners[k] for k in (0, 1, 2, 0, 2, 3)], axis=1).reshape(-1, 3)


def surface(kind, n_faces):
    vertices, faces = torus(n_faces)
    rng = np.random.default_rng(0)
    if kind == "soup":
        return vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)
    if kind == "holes":
        return vertices, faces[rng.random(len(faces)) < 0.9]
    if kind == "shuffled":
        place = rng.permutation(len(vertices))
        return vertices[np.argsort(place)], place[faces[rng.permutation(len(faces))]]
    return vertices, faces


def memory(name):
    return 1024 * int(re.search(rf"{name}:\s+(\d+)", STATUS.read_text())[1])


kind, n_faces = sys.argv[1], int(float(sys.argv[2]))
none = np.zeros(0, dtype=np.int64)
mesh_facts(*torus(200), np.arange(200), none)  # imports what it needs
vertices, faces = surface(kind, n_faces)
facet_ids = np.arange(len(faces))
RESET.write_text("5")  # the peak begins here
before, start = memory("VmRSS"), time.process_time()
facts = mesh_facts(vertices, faces, facet_ids, none)
taken = time.process_time() - start
size = (memory("VmHWM") - before) / len(faces)
print(f"{kind}, {len(faces)} facets: {taken:.2f} s, {size:.0f} bytes a facet; {facts}")
