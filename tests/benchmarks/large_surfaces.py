"""Streamed surfaces of 10,000 to 100 million facets: CPU time, peak of memory and of addresses, each in a process.

Run with `python tests/benchmarks/large_surfaces.py growth hundred empty formats others defect --folder TMP
--json FILE`; the files are made by formula (`write_ball` of `tests/streams.py`) in a folder of their own, which is
removed.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

CODE = """
import json, resource, sys, time
path, what, limit = sys.argv[1], sys.argv[2], int(sys.argv[3])
if limit:
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
import numpy as np, voxkernel
wall, begin = time.perf_counter(), time.process_time()
surface = voxkernel.stream_mesh(path)
if what == "kernel":
    kernel = voxkernel.exact_kernel(surface)
    said = {"dimension": kernel.dimension, "volume": kernel.volume, "faces": len(kernel.face_facets)}
    if kernel.is_empty:
        said["witness_verified"] = kernel.certificate.verify()
elif what == "voxels":
    said = {"volume_bounds": voxkernel.voxel_kernel(surface, depth=7).volume_bounds}
elif what == "violation":
    points = np.random.default_rng(0).uniform(-1, 1, (1000, 3))
    said = {"mean": float(voxkernel.violation(surface, points).mean())}
elif what == "center":
    said = {"violation_bounds": voxkernel.best_center(surface).violation_bounds}
else:
    score = voxkernel.starshapeness(surface, detail=what == "detail")
    said = {"verdict": score.verdict, "ratio": score.ratio, "violation_bounds": score.violation_bounds}
    if score.visible is not None:
        said["visible"] = score.visible.fraction
status = dict(line.split(":", 1) for line in open("/proc/self/status"))
found = {"facets": surface.n_facets, "cpu_s": round(time.process_time() - begin, 2)}
found["seconds"] = round(time.perf_counter() - wall, 2)
found["peak_MB"], found["addresses_MB"] = (int(status[k].split()[0]) // 1024 for k in ("VmHWM", "VmPeak"))
print(json.dumps({**found, **said}))
"""
SIDES = {"10k": 71, "100k": 224, "1M": 708, "10M": 2237, "30M": 3873, "100M": 7072}


def ball(folder, size, bend=0.0):
    """Write the ball, or the bent one, whose kernel is empty."""
    from streams import write_ball

    path = folder / f"{size}-{bend:g}.ply"
    if not path.exists():
        write_ball(path, SIDES[size], SIDES[size], 0.2, bend=bend)
    return path


def formats(folder):
    """A million facets as .glb, .zarr, .parquet and a folder of tiles."""
    import pyarrow
    import pyarrow.parquet
    import zarr

    import voxkernel

    mesh = voxkernel.as_mesh(ball(folder, "1M"))
    yield ball(folder, "1M")
    mesh.write(folder / "a.glb")
    yield folder / "a.glb"
    corners = mesh.vertices[mesh.faces].reshape(-1, 9)
    made = zarr.create_array(folder / "a.zarr", shape=corners.shape, chunks=(1 << 16, 9), dtype=float)
    made[:] = corners
    yield folder / "a.zarr"
    names = [f"{axis}{k}" for k in range(3) for axis in "xyz"]
    pyarrow.parquet.write_table(pyarrow.table(dict(zip(names, corners.T, strict=True))), folder / "a.parquet")
    yield folder / "a.parquet"
    (folder / "tiles").mkdir()
    for k, faces in enumerate(np.array_split(mesh.faces, 64)):
        used, local = np.unique(faces, return_inverse=True)
        voxkernel.as_mesh((mesh.vertices[used], local.reshape(-1, 3))).write(folder / "tiles" / f"{k:02}.ply")
    yield folder / "tiles"


def cases(names, folder):
    """What is run: a name, a file, a question, a limit on the address space."""
    if "growth" in names:
        for size in ("10k", "100k", "1M", "10M", "30M"):
            yield f"exact kernel, {size}", ball(folder, size), "kernel", 3 << 30 if size == "30M" else 0
        ball(folder, "30M").unlink()
    if "hundred" in names:
        yield "exact kernel, 100M", ball(folder, "100M"), "kernel", 0
        ball(folder, "100M").unlink()
    if "empty" in names:
        for size in ("1M", "10M"):
            yield f"empty kernel, {size}", ball(folder, size, 2.0), "kernel", 0
    if "formats" in names:
        for path in formats(folder):
            yield f"exact kernel, 1M, {path.suffix or path.name}", path, "kernel", 0
    if "others" in names:
        for what in ("voxels", "violation", "score", "center"):
            yield f"{what}, 10M", ball(folder, "10M"), what, 0
    if "defect" in names:
        for what in ("center", "score", "detail"):
            yield f"{what}, empty kernel, 10M", ball(folder, "10M", 2.0), what, 0


def main():
    """Run what is named, print and write rows."""
    parser = argparse.ArgumentParser()
    parser.add_argument("names", nargs="+", choices=("growth", "hundred", "empty", "formats", "others", "defect"))
    parser.add_argument("--folder")
    parser.add_argument("--json")
    arguments = parser.parse_args()
    sys.path.insert(0, str(Path(__file__).parents[1]))
    rows = []
    with tempfile.TemporaryDirectory(dir=arguments.folder) as folder:
        for name, path, what, limit in cases(arguments.names, Path(folder)):
            command = [sys.executable, "-c", CODE, str(path), what, str(limit)]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            last = done.stderr.splitlines()[-1:]
            rows.append({"case": name, **(json.loads(done.stdout) if done.returncode == 0 else {"failed": last})})
            print(rows[-1], flush=True)
    if arguments.json:
        Path(arguments.json).write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
