"""Damaged files of every format, read in child processes with limits: each must be read, or refused in one line.

    python tests/faults/fuzz.py                                   # 500 inputs a format
    python tests/faults/fuzz.py --formats vtu,off --count 10000 --seed 3 --out found
    python tests/faults/fuzz.py --formats vtu --seed 3 --only 271 # one input again, with its traceback
    python tests/faults/fuzz.py --formats vtu --file found/vtu-271.vtu

An input is a function of format, seed and number. It fails if reading it ends in an error that is none of the
library's, in a message of several lines, in a warning or printed words, in the death of the process, after more than
2 s of processor time, with more than 512 MB of memory, or in something that is no mesh; and if an input that only says
the same in other words is refused or read as something else. What the library reads in a process of its own has the
limits of that process. A run with `--out` goes on where it stopped.
"""

import argparse
import faulthandler
import gc
import json
import mmap
import os
import random
import resource
import signal
import struct
import sys
import tempfile
import time
import traceback
import warnings
from pathlib import Path

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "VTK_SMP_MAX_THREADS"):
    os.environ.setdefault(name, "1")  # a process with threads must not be forked
os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")  # the others reserve gigabytes of addresses
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]  # shapes.py

import numpy as np  # noqa: E402
from fuzz_formats import FORMATS  # noqa: E402

SECONDS = 2.0  # of processor time, for an input of some kilobytes
MEGABYTES = 512  # above what the process had before
HANG = 60.0  # seconds without an input finished: asleep, for processor time is bounded already
BATCH = 500  # inputs of one child
SAME = 0.1  # share of inputs that say the same in other words
MEMORY_DISK = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
MOST_DEATHS = 60  # of one format: each costs a new process, and more tell nothing new


def make_input(name, seed, number):
    """The bytes, the seed file they come from, and whether they must mean the same as that."""
    form = FORMATS[name]
    rng = random.Random(f"{name}/{seed}/{number}")
    seeds = form.seeds
    which = rng.randrange(len(seeds))
    if form.same is not None and rng.random() < SAME:
        return form.same(rng, seeds[which]), which, True
    return form.damage(rng, seeds[which]), which, False


# ---------------------------------------------------------------- one input


def judge(form, path, expected=None):
    """Read a file: ("accepted" or "refused" or a kind of failure, details)."""
    from voxkernel.errors import VoxKernelError

    stray = []
    sys.unraisablehook = lambda args: stray.append(repr(args.exc_value))
    try:
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            meaning = form.read(path)
        if form.law is not None:
            form.law(path.read_bytes(), meaning)
    except MemoryError as error:
        return "memory", _where(error)
    except AssertionError as error:
        return "meaning", _where(error)
    except Exception as error:
        text = str(error)
        is_own = isinstance(error, VoxKernelError)
        if form.errors == "values" and not is_own:
            plain = type(error) in (ValueError, FileNotFoundError) or type(error).__module__.startswith("voxkernel")
            is_own = plain and ("must" in text or "cannot" in text)
        if not is_own:
            return "exception", _where(error)
        if not text.strip() or any(mark in text for mark in "\n\r\v\f\x85\u2028\u2029"):
            return "message", f"{_where(error)[:-1]}; {text.count(chr(10))} line ends)"
        if _has_memory_error(error):
            return "memory", _where(error)
        if expected is not None:
            return "meaning", f"the same in other words is refused: {_where(error)}"
        verdict = "refused", ""
    else:
        verdict = "accepted", ""
        if expected is not None and not _equal(meaning, expected):
            return "meaning", "the same in other words is read as something else"
    warned = [one for one in warned if not form.warns or form.warns not in str(one.message)]
    if warned:
        first = warned[0]
        return "warning", f"{first.category.__name__}: {first.message} ({_short(first.filename)}:{first.lineno})"
    if stray:
        return "unraisable", stray[0]
    return verdict


def _equal(one, two):
    return len(one) == len(two) and all(np.array_equal(a, b) for a, b in zip(one, two, strict=True))


def _has_memory_error(error):
    while error is not None:
        if isinstance(error, MemoryError):
            return True
        error = error.__cause__ or error.__context__
    return False


def _short(filename):
    return "/".join(Path(filename).parts[-2:])


def _where(error):
    """The error in one line, and the innermost line of the library it came through."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if "voxkernel" in frame.filename] or frames
    place = f"{_short(own[-1].filename)}:{own[-1].lineno} in {own[-1].name}"
    return f"{type(error).__name__}: {' '.join(str(error).split())[:300]} ({place})"


# ---------------------------------------------------------------- many inputs, in a child


class Shared:
    """Numbers that outlive a child: the input it is at, and what it counted."""

    def __init__(self):
        self._map = mmap.mmap(-1, 40)

    def __getitem__(self, k):
        return struct.unpack_from("<q", self._map, 8 * k)[0]

    def __setitem__(self, k, value):
        struct.pack_into("<q", self._map, 8 * k, value)


AT, ACCEPTED, REFUSED, SAID_SAME, DONE = range(5)


def run_batch(name, seed, numbers, shared, work, files=None):
    """In a child that ends here: read the inputs, one after the other, within the limits."""
    form = FORMATS[name]
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    path = work / f"input{form.suffix}"
    printed = os.open(work / "printed", os.O_RDWR | os.O_CREAT | os.O_TRUNC)
    failures = (work / "failures").open("a")
    with (work / "stack").open("w") as stack:
        faulthandler.enable(stack, all_threads=False)
        faulthandler.register(signal.SIGPROF, stack, all_threads=False, chain=True)
        for standard in (1, 2):
            os.dup2(printed, standard)
        expected = []
        for data in form.seeds:
            path.write_bytes(data)
            expected.append(form.read(path))
        for number in numbers:
            if files is None:
                data, which, is_same = make_input(name, seed, number)
            else:
                data, which, is_same = files[number], 0, False
            path.write_bytes(data)
            start = os.fstat(printed).st_size
            _limit(True)
            shared[AT] = number
            kind, details = judge(form, path, expected[which] if is_same else None)
            _limit(False)
            details = details[:400]
            if kind in ("accepted", "refused") and os.fstat(printed).st_size > start:
                kind, details = "printed", os.pread(printed, 200, start).decode("utf-8", "replace")
            shared[SAID_SAME] += is_same
            if kind == "accepted":
                shared[ACCEPTED] += 1
            elif kind == "refused":
                shared[REFUSED] += 1
            else:
                failures.write(json.dumps([number, kind, details]) + "\n")
                failures.flush()
    shared[DONE] = 1
    os._exit(0)


def _limit(is_on):
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * mmap.PAGESIZE + MEGABYTES * 2**20 if is_on else resource.RLIM_INFINITY
    resource.setrlimit(resource.RLIMIT_AS, (most, resource.RLIM_INFINITY))
    signal.setitimer(signal.ITIMER_PROF, SECONDS if is_on else 0.0)


def in_child(name, seed, numbers, work, files=None):
    """Run inputs in a child; gives the failures, the number it died at or None, and the counts."""
    shared = Shared()
    shared[AT] = -1
    (work / "failures").write_text("")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pid = os.fork()
    if pid == 0:
        try:
            run_batch(name, seed, numbers, shared, work, files)
        except BaseException:  # trouble of the suite itself
            (work / "trouble").write_text(traceback.format_exc())
        os._exit(1)
    status = _wait(pid, shared)
    found = [json.loads(line) for line in (work / "failures").read_text().splitlines()]
    if (work / "trouble").exists():
        text = (work / "trouble").read_text()
        (work / "trouble").unlink()
        raise RuntimeError(f"the suite itself fails at {name} {shared[AT]} or right behind: {text}")
    died = None
    if not shared[DONE]:
        died = shared[AT]
        end = signal.Signals(os.WTERMSIG(status)).name if os.WIFSIGNALED(status) else f"exit {os.WEXITSTATUS(status)}"
        kind = {"SIGPROF": "time", "SIGKILL": "hang"}.get(end, "death")
        found.append([died, kind, f"{end} {_stack(work)}"])
    return found, died, [shared[k] for k in (ACCEPTED, REFUSED, SAID_SAME)]


def _stack(work):
    """The innermost lines of the library in what faulthandler wrote."""
    lines = [line.strip() for line in (work / "stack").read_text().splitlines() if line.strip().startswith("File")]
    lines = [line for line in lines if "voxkernel" in line] or lines
    words = [line.split('"') for line in lines[:1]]
    return "; ".join(f"({_short(word[1])}{word[2].replace(', line ', ':')})" for word in words)


def _wait(pid, shared):
    last, since, pause = None, time.monotonic(), 0.001
    while True:
        done, status = os.waitpid(pid, os.WNOHANG)
        if done:
            return status
        if shared[AT] != last:
            last, since = shared[AT], time.monotonic()
        elif time.monotonic() - since > HANG:
            os.kill(pid, signal.SIGKILL)
        time.sleep(pause)
        pause = min(0.05, pause * 1.5)


# ---------------------------------------------------------------- one format


def signature(kind, details):
    """What makes two failures the same: the kind and the place, or the words without their numbers."""
    if details.endswith(")"):
        return f"{kind} {details.split(':')[0].split(' ')[0]} {details.rpartition('(')[2]}"
    return f"{kind} {''.join(c for c in details if not c.isdigit())[:60]}"


def run_format(name, seed, count, out):
    """Read `count` inputs of a format; resumes from, and writes, `out`/`name`-`seed`.json."""
    out.mkdir(parents=True, exist_ok=True)
    file = out / f"{name}-{seed}.json"
    state = {"format": name, "seed": seed, "next": 0, "accepted": 0, "refused": 0, "same": 0, "failed": 0, "deaths": 0,
             "seconds": 0.0, "failures": {}}  # fmt: skip
    if file.exists():
        state = json.loads(file.read_text())
    suffix = FORMATS[name].suffix
    with tempfile.TemporaryDirectory(prefix="fuzz-", dir=MEMORY_DISK) as folder:
        work = Path(folder)
        while state["next"] < count and state["deaths"] < MOST_DEATHS:
            start = _processor_seconds()
            stop = min(state["next"] + BATCH, count)
            found, died, counts = in_child(name, seed, range(state["next"], stop), work)
            if died == -1:
                raise RuntimeError(f"the process dies on a seed of {name}: {found}")
            for key, n in zip(("accepted", "refused", "same"), counts, strict=True):
                state[key] += n
            state["next"] = stop if died is None else died + 1
            state["deaths"] += died is not None
            for number, kind, details in found:
                state["failed"] += 1
                entry = state["failures"].setdefault(
                    signature(kind, details), {"n": 0, "number": number, "kind": kind, "details": details}
                )
                entry["n"] += 1
                if entry["n"] == 1:
                    data = make_input(name, seed, number)[0]
                    example = out / f"{name}-{seed}-{number}{suffix}"
                    example.write_bytes(data)
                    repeats = bool(in_child(name, seed, [number], work)[0])
                    entry |= {"file": example.name, "bytes": len(data), "repeats": repeats}
            state["seconds"] = round(state["seconds"] + _processor_seconds() - start, 3)
            beside = file.with_suffix(".part")
            beside.write_text(json.dumps(state, indent=1))
            beside.replace(file)
    return state


def _processor_seconds():
    usage = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in usage)


def summary(state):
    """One line."""
    end = "" if state["deaths"] < MOST_DEATHS else f", stopped after {MOST_DEATHS} deaths"
    return (
        f"{state['format']:15} {state['next']:6} inputs  {state['accepted']:6} accepted  {state['refused']:6} refused  "
        f"{state['failed']:5} failures of {len(state['failures'])} kinds  {state['seconds']:7.1f} s{end}"
    )


def lines_of(state):
    """One line for each kind of failure: enough to make it again."""
    for entry in state["failures"].values():
        rest = "" if entry["repeats"] else ", not alone"
        yield (
            f"  {entry['kind']:10} {entry['n']:5} x  --formats {state['format']} --seed {state['seed']} --only "
            f"{entry['number']} ({entry['bytes']} bytes{rest}): {entry['details']}"
        )


def warm_up(name):
    """Import, compile and make seeds before the first fork, so that no input pays for it."""
    import blosc  # noqa: F401
    import pyarrow.parquet  # noqa: F401
    import shapes

    import voxkernel
    from voxkernel.polyhedral import PolyhedralMesh

    form = FORMATS[name]
    if form.read.__name__ == "read_cells":
        for body in (shapes.l_prism(), shapes.two_boxes(), shapes.s_tetromino(), shapes.torus()):
            voxkernel.exact_kernel(body)
            voxkernel.cell_kernels(PolyhedralMesh.from_cells([body]))
    with tempfile.TemporaryDirectory(prefix="fuzz-", dir=MEMORY_DISK) as folder:
        path = Path(folder) / f"seed{form.suffix}"
        for data in form.seeds:
            form.damage(random.Random(0), data)
            path.write_bytes(data)
            form.read(path)
    gc.collect()
    gc.freeze()


# ---------------------------------------------------------------- the command


def again(form, path):
    """One input in this process, without limits, with its whole traceback."""
    print(f"{path}: {path.stat().st_size} bytes", flush=True)
    print(*judge(form, path), flush=True)
    form.read(path)


def main(words=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--formats", default=",".join(FORMATS), help="names with commas between; all by default")
    parser.add_argument("--count", type=int, default=500, help="inputs a format")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, help="folder for results and failing files; a run goes on where it stopped")
    parser.add_argument("--only", type=int, help="read the input of this number again, without limits")
    parser.add_argument("--file", type=Path, help="read this file again, without limits")
    parser.add_argument("--quiet", action="store_true", help="only the line of each format")
    args = parser.parse_args(words)
    names = args.formats.split(",")
    unknown = sorted(set(names) - set(FORMATS))
    if unknown:
        parser.error(f"--formats must be of {', '.join(FORMATS)}; got {', '.join(unknown)}")
    out = args.out or Path(tempfile.mkdtemp(prefix="fuzz-"))
    out.mkdir(parents=True, exist_ok=True)
    if args.only is not None or args.file is not None:
        form = FORMATS[names[0]]
        path = args.file
        if path is None:
            path = out / f"{names[0]}-{args.seed}-{args.only}{form.suffix}"
            path.write_bytes(make_input(names[0], args.seed, args.only)[0])
        again(form, path)
        return 0
    failed = False
    for name in names:
        try:
            warm_up(name)
            state = run_format(name, args.seed, args.count, out)
        except Exception as error:  # the other formats are still worth their run
            failed = True
            print(f"{name:15} cannot be run: {_where(error)}", flush=True)
            continue
        failed |= state["failed"] > 0
        print(summary(state), flush=True)
        if not args.quiet:
            print(*lines_of(state), sep="\n", end="\n" if state["failures"] else "", flush=True)
    print(f"results and failing files: {out}")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
