"""The readers under atheris, which looks for inputs that reach new lines.

    pip install atheris && python tests/faults/fuzz_atheris.py off -max_total_time=300

The first word is a format of `fuzz_formats.py`; the rest goes to libFuzzer. Starts from the sound files made by
formula and damages them as `fuzz.py` does, or as libFuzzer does. What is a failure is the same as there; death, time
and memory are libFuzzer's (-timeout, -rss_limit_mb).
"""

import random
import sys
import tempfile
from pathlib import Path

import atheris

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent), str(HERE.parent.parent)]

# Readers only: compiled loops and what lies behind them would be slower and tell nothing about files.
READERS = [
    "voxkernel.mesh.ply", "voxkernel.mesh.files", "voxkernel.polyhedral.files", "voxkernel.vdb.file_format",
    "voxkernel.vdb.read_tree", "voxkernel.vdb.node_values", "voxkernel.vdb", "voxkernel.grid", "voxkernel.run_table",
    "voxkernel.report.rows", "voxkernel.report.pictures", "voxkernel.evaluation.inputs", "voxkernel.mesh",
]  # fmt: skip
with atheris.instrument_imports(include=READERS):
    import fuzz

    import voxkernel.mesh.as_mesh
    import voxkernel.polyhedral.cell_kernels
    import voxkernel.vdb.vdb_file  # noqa: F401


def main():
    name = sys.argv[1]
    form = fuzz.FORMATS[name]
    fuzz.warm_up(name)
    folder = Path(tempfile.mkdtemp(prefix="fuzz-", dir=fuzz.MEMORY_DISK))
    corpus = folder / "corpus"
    corpus.mkdir()
    for k, data in enumerate(form.seeds):
        (corpus / str(k)).write_bytes(data)
    path = folder / f"input{form.suffix}"

    def read(data):
        path.write_bytes(data)
        kind, details = fuzz.judge(form, path)
        if kind not in ("accepted", "refused"):
            raise RuntimeError(f"{kind}: {details}")

    def damage(data, max_size, seed):
        rng = random.Random(seed)
        try:
            made = form.damage(rng, data if rng.random() < 0.5 else rng.choice(form.seeds))
        except Exception:  # structure that is no longer there
            made = atheris.Mutate(data, max_size)
        return made[:max_size]

    options = ["-timeout=10", f"-rss_limit_mb={4 * fuzz.MEGABYTES}", "-max_len=300000"]
    atheris.Setup([sys.argv[0], *options, *sys.argv[2:], str(corpus)], read, custom_mutator=damage)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
