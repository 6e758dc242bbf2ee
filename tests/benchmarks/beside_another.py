"""This checkout beside another version of the package: the same calls, in turn, in processes of their own, in CPU time.

    python tests/benchmarks/beside_another.py --other DIR [--json FILE] [--rounds N]

DIR holds the other version's `voxkernel/`, ready to import. Whole processes count from their start to their end;
calls are warmed up first, and the minimum over all rounds counts.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

HERE = Path(__file__).resolve().parents[2]
# Run in either version: makes the meshes, then prints the seconds of every call as one JSON line.
CALLS = """
import json, sys, time
sys.path.insert(0, sys.argv[1])
import numpy as np, shapes, voxkernel as vk
from voxkernel.demo_shapes import face, urchin

rng = np.random.default_rng(0)
ball, faces = shapes.uv_sphere(5, 5)
star = vk.as_mesh((ball * rng.uniform(0.85, 1.15, (len(ball), 1)), faces))
bumpy, bumps = shapes.uv_sphere(160, 320)
bumpy = vk.as_mesh((bumpy * (1 + 0.02 * rng.uniform(-1, 1, (len(bumpy), 1))), bumps))
cube, spikes, mask = vk.as_mesh(shapes.cube()), urchin(), face()
points = rng.normal(size=(20_000, 3))
calls = {
    "exact_kernel, cube": lambda: vk.exact_kernel(cube),
    "exact_kernel, star of 40 facets": lambda: vk.exact_kernel(star),
    "exact_kernel, urchin of 20k": lambda: vk.exact_kernel(spikes),
    "exact_kernel, noisy ball of 102k": lambda: vk.exact_kernel(bumpy),
    "voxel_kernel, urchin, depth 9": lambda: vk.voxel_kernel(spikes, depth=9),
    "voxel_kernel, face, tolerance 0.05, depth 7": lambda: vk.voxel_kernel(mask, depth=7, tolerance=0.05),
    "best_center, face with a hook": lambda: vk.best_center(face(hook=0.3)),
    "violation, face, 20k points": lambda: vk.violation(mask, points),
    "starshapeness, urchin": lambda: vk.starshapeness(spikes),
    "spherical_map, urchin": lambda: vk.spherical_map(spikes),
}
repeats = int(sys.argv[2])
answer = {}
for name, call in calls.items():
    call()
    best = float("inf")
    for _ in range(repeats if "cube" not in name and "star of" not in name else 50 * repeats):
        begin = time.process_time()
        call()
        best = min(best, time.process_time() - begin)
    answer[name] = best
print(json.dumps(answer))
"""
FIRST = """
import json, time, numpy
begin = time.process_time()
import voxkernel
ready = time.process_time()
voxkernel.exact_kernel(([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))
end = time.process_time()
print(json.dumps({"import beyond NumPy": ready - begin, "first exact_kernel(tetrahedron)": end - ready}))
"""


def run(words, folder, cwd):
    """Run Python beside a version; give what it prints and its CPU seconds."""
    env = {**os.environ, "PYTHONPATH": str(folder)}
    env.pop("PYTHONDONTWRITEBYTECODE", None)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([sys.executable, *words], env=env, cwd=cwd, capture_output=True, text=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return done.stdout, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def once(folder, work):
    """Seconds of everything, in one version."""
    seconds = json.loads(run(["-c", CALLS, str(HERE / "tests"), "3"], folder, work)[0])
    seconds |= json.loads(run(["-c", FIRST], folder, work)[0])
    score = ["-m", "voxkernel.cli.main", "score", "ball.ply", "-q"]
    seconds["voxkernel score, 10k facets"] = run(score, folder, work)[1]
    return seconds


def main():
    """Take turns and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--other", required=True)
    parser.add_argument("--json")
    parser.add_argument("--rounds", type=int, default=3)
    args = parser.parse_args()
    versions = {"other": Path(args.other).resolve(), "this": HERE}
    best = {name: {} for name in versions}
    with TemporaryDirectory() as work:
        write = "import sys; sys.path.insert(0, sys.argv[1]); import shapes, voxkernel as vk; "
        write += "vk.as_mesh(shapes.uv_sphere(50, 100)).write('ball.ply')"
        run(["-c", write, str(HERE / "tests")], HERE, work)
        for _ in range(args.rounds):
            for name, folder in versions.items():
                for what, seconds in once(folder, work).items():
                    best[name][what] = min(seconds, best[name].get(what, float("inf")))
    print("| CPU ms | other | this | this / other |\n|---|---|---|---|")
    for what, seconds in best["this"].items():
        other = best["other"][what]
        print(f"| {what} | {1e3 * other:.3g} | {1e3 * seconds:.3g} | {seconds / other:.2f} |")
    if args.json:
        Path(args.json).write_text(json.dumps(best, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
