"""`exact_kernel` beside its rivals, by size: the same meshes, in turn, CPU seconds, the minimum of some rounds.

    python tests/benchmarks/size_classes.py [--cgal DIR] [--before DIR] [--large] [--json FILE [--seconds S]]

Rivals are CGAL's `Polygon_mesh_processing::kernel` (6.2 or newer; DIR holds `usr/include`, as Debian's `libcgal-dev`,
`libboost-dev` and `libmpfr-dev` unpack; compiled in about two minutes), SciPy's `HalfspaceIntersection` about a point
found by HiGHS, and another version of this package (DIR holds its `voxkernel/`, ready to import). What is not at hand
is named and left out. All start from a mesh in memory. A rival counts where its volume is within 1e-9 of ours, or
within 1e-9 of the enclosed volume where ours is 0. A mesh whose row is in FILE is not measured again: so it can be
done in pieces of about S seconds.
"""

import argparse
import ctypes
import json
import os
import subprocess
import sys
import time
from math import exp, log
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from flat_and_small import TURN, flat_cube
from synthetic import bumpy, ellipsoid, geodesic_sphere, scipy_kernel

import voxkernel

HERE = Path(__file__).resolve().parent
CLASSES = ((0, 300), (300, 3_000), (3_000, 30_000), (30_000, 10**9))
LONGEST = (5.0, 0.3)  # seconds after which a rival takes no second, no third turn at a mesh
# Kept alive by a pipe: takes a mesh and a number of calls, answers with the seconds of the fastest.
CHILD = """
import json, sys, time
import numpy as np
import voxkernel

path, mesh = None, None
for line in sys.stdin:
    wanted, calls = json.loads(line)
    if wanted != path:
        with np.load(wanted) as stored:
            path, mesh = wanted, voxkernel.TriangleMesh.from_triangles(stored["vertices"], stored["faces"])
    best = float("inf")
    for _ in range(calls):
        begin = time.process_time()
        kernel = voxkernel.exact_kernel(mesh)
        best = min(best, time.process_time() - begin)
    print(json.dumps([best, kernel.volume, len(kernel.face_facets)]), flush=True)
"""


class Version:
    """A version of this package in a process of its own."""

    def __init__(self, folder, work):
        self._child = subprocess.Popen(
            [sys.executable, "-c", CHILD], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=work,
            env={**os.environ, "PYTHONPATH": str(folder)},
        )  # fmt: skip

    def __call__(self, mesh, path, calls):
        self._child.stdin.write(json.dumps([str(path), calls]) + "\n")
        self._child.stdin.flush()
        return json.loads(self._child.stdout.readline())


class Scipy:
    """HiGHS and Qhull."""

    def __call__(self, mesh, path, calls):
        best = float("inf")
        for _ in range(calls):
            begin = time.process_time()
            try:
                volume = scipy_kernel(mesh.vertices, mesh.faces)
            except Exception as error:  # whatever Qhull objects to
                return [time.process_time() - begin, f"{type(error).__name__}", 0]
            best = min(best, time.process_time() - begin)
        return [best, volume, 0]


class Cgal:
    """CGAL in a library of our own, compiled where it is not there yet."""

    def __init__(self, root, work):
        compiled = Path(os.environ.get("VOXKERNEL_CGAL_LIBRARY", Path(work) / "libcgal_kernel.so"))
        if not compiled.exists():
            folder = root / "usr" / "lib" / "x86_64-linux-gnu"
            subprocess.run(
                [
                    os.environ.get("CXX", "c++"), "-O3", "-DNDEBUG", "-std=c++17", "-shared", "-fPIC",
                    f"-I{root / 'usr' / 'include'}", f"-I{root / 'usr' / 'include' / 'x86_64-linux-gnu'}",
                    str(HERE / "cgal_kernel.cpp"), f"-L{folder}", "-lmpfr", "-lgmp", "-o", str(compiled),
                ],
                check=True,
            )  # fmt: skip
        self._library = ctypes.CDLL(str(compiled))
        self._library.cgal_surface.restype = ctypes.c_void_p
        self._library.cgal_kernel.restype = ctypes.c_double
        self._surface, self._path = None, None

    def __call__(self, mesh, path, calls):
        if path != self._path:
            self._library.cgal_free(ctypes.c_void_p(self._surface))
            vertices, faces = np.ascontiguousarray(mesh.vertices), np.ascontiguousarray(mesh.faces)
            self._surface = self._library.cgal_surface(
                vertices.ctypes.data_as(ctypes.c_void_p), ctypes.c_int64(len(vertices)),
                faces.ctypes.data_as(ctypes.c_void_p), ctypes.c_int64(len(faces)),
            )  # fmt: skip
            self._path = path
        if not self._surface:
            return [0.0, "not a surface for it", 0]
        n_faces, volume = ctypes.c_int64(), ctypes.c_double()
        call = self._library.cgal_kernel
        best = min(
            call(ctypes.c_void_p(self._surface), ctypes.byref(n_faces), ctypes.byref(volume)) for _ in range(calls)
        )
        return [best, volume.value, n_faces.value]


def star(n_facets, seed):
    """Corners of a sphere at random distances."""
    vertices, faces = geodesic_sphere(n_facets)
    return vertices * np.random.default_rng(seed).uniform(0.85, 1.15, (len(vertices), 1)), faces


def formulas():
    """Shapes by formula: name -> (vertices, faces)."""
    found = {"cube, 12 facets": flat_cube(1), "turned cube, 768 flat facets": flat_cube(8, TURN)}
    found |= {f"star, {n} facets": star(n, n) for n in (20, 80, 180, 320, 980, 2_880)}
    for n in (300, 1_000, 3_000, 10_000, 40_000):
        found |= {f"bumps {a}, about {n} facets": bumpy(n, a) for a in (0.5, 0.3)}
        if n < 40_000:
            found[f"ellipsoid, about {n} facets"] = ellipsoid(n)
    return found


def large():
    """The large ones: many facets bound the kernel, nearly all, flat sides."""
    return {
        "bumps 0.22, 100k facets": bumpy(100_000, 0.22),
        "ellipsoid, 100k facets": ellipsoid(100_000),
        "bumps 0.22, 1M facets": bumpy(1_000_000, 0.22),
        "cube, 1M flat facets": flat_cube(289),
    }


def meshes(chosen):
    """Name -> mesh, sorted by size."""
    found = dict(chosen)
    return dict(
        sorted(
            ((n, m if hasattr(m, "faces") else voxkernel.as_mesh(m)) for n, m in found.items()),
            key=lambda item: len(item[1].faces),
        )
    )


def data_meshes():
    """The closed meshes of the data folder, as triangles."""
    folder = Path(os.environ.get("VOXKERNEL_DATA", HERE.parents[2] / "shared" / "data")) / "closed"
    if not folder.exists():
        print(f"no data at {folder}; set VOXKERNEL_DATA")
        return {}
    read = {path.stem: voxkernel.as_mesh(path) for path in sorted(folder.glob("*.ply"))}
    return {name: voxkernel.TriangleMesh.from_triangles(m.vertices, m.faces) for name, m in read.items()}


def in_turn(rivals, mesh, path, rounds):
    """The best seconds of every rival, its volume and faces; rivals take turns."""
    best = {}
    spent = dict.fromkeys(rivals, 0.0)
    for turn in range(rounds):
        for name, rival in rivals.items():
            if turn and spent[name] > LONGEST[min(turn, 2) - 1]:
                continue
            once = best[name][0] if turn else 1.0
            calls = max(1, min(100, int(0.03 / max(once, 1e-6))))
            answer = rival(mesh, path, calls if turn else 1)
            spent[name] += answer[0] * (calls if turn else 1)
            if turn and answer[0] > best[name][0]:
                continue
            best[name] = answer
    return best


def is_right(volume, ours, enclosed):
    """Whether a rival counts."""
    if isinstance(volume, str):
        return False
    return abs(volume - ours) <= (1e-9 * abs(ours) if ours else 1e-9 * abs(enclosed))


def print_row(row, rivals):
    """Milliseconds of the rivals for one mesh."""
    seconds, right = row["seconds"], row["right"]
    cells = (
        f"{1e3 * seconds[rival]:.3g}{'' if rival in right else ' (wrong)'}" if rival in seconds else "-"
        for rival in rivals
    )
    print(f"| {row['mesh']} | {row['facets']} | {row['faces']} | {' | '.join(cells)} |", flush=True)


def print_classes(rows, peers, mine):
    """Geometric means over size classes, of the fastest peer that is right."""
    print(f"| facets | meshes | {' | '.join(f'{m} / best peer' for m in mine)} | slowest: {mine[0]} / best peer |")
    print("|---|---|" + "---|" * (len(mine) + 1))
    for low, high in CLASSES:
        chosen = [row for row in rows if low <= row["facets"] < high and any(p in row["right"] for p in peers)]
        if not chosen:
            continue
        best = [min(row["seconds"][p] for p in peers if p in row["right"]) for row in chosen]
        cells = []
        for name in mine:
            logs = [log(row["seconds"][name] / b) for row, b in zip(chosen, best, strict=True)]
            cells.append(f"{exp(sum(logs) / len(logs)):.2f}")
        slowest = max(zip(chosen, best, strict=True), key=lambda pair: pair[0]["seconds"][mine[0]] / pair[1])
        ratio = slowest[0]["seconds"][mine[0]] / slowest[1]
        name = f"{low} to {high}" if high < 10**9 else f"from {low}"
        print(f"| {name} | {len(chosen)} | {' | '.join(cells)} | {ratio:.2f}, {slowest[0]['mesh']} |")


def main():
    """Take turns and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cgal", type=Path, help="root folder of CGAL's headers; `/` where they are installed")
    parser.add_argument("--cgal-most", type=int, default=12_000, help="facets of the largest mesh that CGAL is asked")
    parser.add_argument("--before", type=Path, help="another version of this package")
    parser.add_argument("--own", action="store_true", help="versions of this package only")
    parser.add_argument("--large", action="store_true", help="the large shapes and no others")
    parser.add_argument("--most", type=int, default=10**9, help="facets of the largest mesh")
    parser.add_argument("--rounds", type=int, default=4)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--seconds", type=float, default=float("inf"), help="begin no mesh after so many")
    args = parser.parse_args()
    begin = time.monotonic()
    with TemporaryDirectory() as work:
        rivals = {"this": Version(HERE.parents[1], work)}
        if args.before:
            rivals["before"] = Version(args.before.resolve(), work)
        if args.cgal:
            rivals["CGAL"] = Cgal(args.cgal, work)
        elif not args.own:
            print("CGAL is not at hand (--cgal): compared with SciPy only")
        if not args.own:
            rivals["SciPy"] = Scipy()
        rows = json.loads(args.json.read_text(encoding="utf-8")) if args.json and args.json.exists() else []
        print(f"| mesh | facets | faces of the kernel | {' | '.join(f'{rival}, ms' for rival in rivals)} |")
        print("|---|---|---|" + "---|" * len(rivals))
        for row in rows:
            print_row(row, rivals)
        chosen = meshes(large() if args.large else {**data_meshes(), **formulas()})
        known = {row["mesh"] for row in rows}
        for name, mesh in ((n, m) for n, m in chosen.items() if len(m.faces) <= args.most and n not in known):
            if time.monotonic() - begin > args.seconds:
                print("stopped; the same command goes on")
                break
            path = Path(work) / f"{len(rows)}.npz"
            np.savez(path, vertices=mesh.vertices, faces=mesh.faces)
            asked = {r: c for r, c in rivals.items() if r != "CGAL" or len(mesh.faces) <= args.cgal_most}
            found = in_turn(asked, mesh, path, args.rounds)
            path.unlink()
            ours = found["this"][1]
            rows.append({
                "mesh": name, "facets": len(mesh.faces), "volume": ours, "faces": found["this"][2],
                "seconds": {rival: answer[0] for rival, answer in found.items()},
                "right": [rival for rival, answer in found.items() if is_right(answer[1], ours, mesh.volume)],
            })  # fmt: skip
            if args.json:
                args.json.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
            print_row(rows[-1], rivals)
    peers = [name for name in rivals if name not in ("this", "before")]
    print()
    if peers:
        print_classes(rows, peers, [name for name in ("this", "before") if name in rivals])


if __name__ == "__main__":
    main()
