"""From paths, folders, globs and URLs to a list of meshes: names, labels, content."""

from __future__ import annotations

import hashlib
import os
import posixpath
from collections import Counter
from collections.abc import Generator, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from voxkernel._extras import optional
from voxkernel._input_file import check_stored_file, input_file
from voxkernel.errors import MeshReadError
from voxkernel.evaluation.file_stamp import FileStamp
from voxkernel.evaluation.object_group import ObjectGroup
from voxkernel.labels import is_label_file
from voxkernel.run_table import defused, extra_of, is_local, open_run, told

__all__ = [
    "BadInput", "Item", "Labels", "content_hash", "count_suffixes", "find_items", "is_private", "labelled",
    "local_copy", "read_labels", "with_data",
]  # fmt: skip

_SURFACES = tuple(".ply .off .obj .stl .gltf .glb .wrl .3ds .3mf .ctm .dae .fbx .tri .vmi .vtp .x3d .x3dv".split())
_SOLIDS = (".hedra", ".mesh", ".vtu")
_KNOWN = frozenset(_SURFACES + _SOLIDS)
_MAGIC = "*?["
_READING = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)  # a pipe is not waited for


class BadInput(ValueError):
    """Arguments of `evaluate` that cannot be meant, as against trouble with a mesh or a cluster."""


@dataclass(frozen=True, slots=True)
class Item:
    """One mesh: the name it has in the table, where it is, and its bytes if workers cannot read it."""

    name: str
    url: str
    label: str | None = None
    view: bool = False
    data: bytes | None = None
    group: ObjectGroup | None = None  # objects of a label image
    known_hash: str = ""  # of an image that is shared out, whose rows also finish together
    finished: str = ""
    known_stamp: FileStamp | None = None
    done: frozenset[int] | None = None  # objects that have their rows from an earlier run

    @property
    def suffix(self) -> str:
        """Lower-case suffix with the dot."""
        url = self.url.lower()
        return ".nii.gz" if url.endswith(".nii.gz") else posixpath.splitext(url)[1]


@dataclass(frozen=True, slots=True)
class Labels:
    """Labels of files: a table by name, or the name of the folder."""

    table: dict[str, str] | None

    def of(self, name: str) -> tuple[str | None, str | None]:
        """Give the label of a file and the entry of the table it was found by."""
        if self.table is None:
            folder = posixpath.dirname(name.rstrip("/"))
            parent = posixpath.basename(os.path.abspath(folder) if folder.endswith("..") else folder)
            return (parent or None), None
        parts = posixpath.normpath(name).split("/")
        ends = ["/".join(parts[k:]) for k in range(len(parts))]  # a table may be relative to any folder above
        for own in (name, *ends, posixpath.splitext(parts[-1])[0]):
            for key in (own, defused(own)):  # a table may be one that this library wrote
                if key in self.table:
                    return self.table[key], key
        return None, None


def read_labels(labels: str | os.PathLike[str] | None) -> Labels | None:
    """Read a CSV with columns `file` and `label`, or take "folders"; None stays None."""
    import csv

    if labels is None:
        return None
    if labels == "folders":
        return Labels(None)
    fs, path = _opened(os.fspath(labels))
    try:
        check_stored_file(fs, path)
        with fs.open(path, "rt", encoding="utf-8-sig", newline="") as stream:
            reader = csv.DictReader(stream)
            if not {"file", "label"} <= set(reader.fieldnames or ()):
                raise BadInput(f"`labels` must have columns file and label; got {reader.fieldnames} in '{labels}'")
            rows: list[tuple[str, str]] = []
            for row in reader:
                if row["file"] is None or row["label"] is None:
                    where = f"'{labels}', line {reader.line_num}"
                    raise BadInput(f"`labels` must have a file and a label in every row; got {where}")
                rows.append((row["file"], row["label"]))
    except UnicodeDecodeError as error:
        raise BadInput(f"`labels` must be text in UTF-8; got '{labels}', {error}") from None
    return Labels({file.replace(os.sep, "/"): label for file, label in rows if file})


def find_items(
    paths: Iterable[str | os.PathLike[str]], left_out: set[str] | None = None, *, label_images: bool = False
) -> list[Item]:
    """Find the meshes of files, folders (with all below), globs and fsspec URLs, sorted by name, each once.

    A file that is named is taken whatever it is; of folders and globs only files with a known suffix are, and the
    names of the others go to `left_out`.
    """
    found: dict[str, str] = {}
    others: set[str] = set()
    for path in paths:
        for name, url in _expanded(os.fspath(path), others):
            found[_printable(name)] = url
    if label_images:  # they have been left out for their suffix
        found |= {_printable(name): name for name in others if is_label_file(name)}
        others = {name for name in others if not is_label_file(name)}
    if left_out is not None:
        left_out |= {_printable(name) for name in others} - found.keys()
    return [Item(name, name if name == url else url) for name, url in sorted(found.items())]


def count_suffixes(names: Iterable[str], *, run: str) -> tuple[tuple[str, int], ...]:
    """Count files by lower-case suffix, the most frequent first; those of the run itself are not counted."""
    fs, path = open_run(run)
    inside = _printable(os.path.realpath(path) if is_local(fs) else fs.unstrip_protocol(path)).rstrip("/") + "/"
    suffixes = [posixpath.splitext(name)[1].lower() for name in names if not _place(name).startswith(inside)]
    return tuple(sorted(Counter(suffixes).items(), key=lambda item: (-item[1], item[0])))


def _place(name: str) -> str:
    """Where a file is, whatever links lead there."""
    local = name.removeprefix("file://")
    return os.path.realpath(local) if _is_local(local) else name


def _expanded(path: str, left_out: set[str]) -> Iterable[tuple[str, str]]:
    """Give the name of each mesh a path leads to, and where it is."""
    if _is_local(path):
        names, others = _divided(_local(path))
        left_out |= {_tidy(n) for n in others}
        return ((_tidy(n), n) for n in names)  # "./x" and "x" are one row
    fs, inner = _opened(path)
    if path.startswith("file://"):
        names, others = _divided(_local(inner))
        left_out |= {fs.unstrip_protocol(n) for n in others}
        return [(fs.unstrip_protocol(n), n) for n in names]
    with told(path):
        if any(c in inner for c in _MAGIC) and not fs.exists(inner):
            listed = sorted(fs.glob(inner, detail=True).items())
            names, others = _divided((n, _known(n)) for n, about in listed if _known(n) or about["type"] != "directory")
        elif fs.isdir(inner):
            names, others = _divided((n, _known(n)) for n in sorted(fs.find(inner)))
        else:
            return [(path, path)]
    left_out |= {fs.unstrip_protocol(n) for n in others}
    return [(fs.unstrip_protocol(n), fs.unstrip_protocol(n)) for n in names]


def _divided(files: Iterable[tuple[str, bool]]) -> tuple[list[str], list[str]]:
    """Divide files into those to take and the others."""
    divided: tuple[list[str], list[str]] = [], []
    for name, taken in files:
        divided[not taken].append(name)
    return divided


def _tidy(path: str) -> str:
    """Write a path as `pathlib` does, which takes its time: most are that already."""
    if os.sep != "/" or not path or path[0] == "." or path[-1] == "/" or "//" in path or "/." in path:
        return str(Path(path)) if path else path
    return path


def _opened(url: str) -> tuple[Any, str]:
    """Give the file system of a URL and the path there; one that is unknown or not installed is bad input."""
    fsspec = optional("fsspec")
    try:
        return fsspec.core.url_to_fs(url)
    except (ImportError, ValueError) as error:
        raise BadInput(f"'{url}' cannot be opened: {error}{extra_of(url)}") from error


def _local(path: str) -> Iterable[tuple[str, bool]]:
    """Expand a path of this machine, relative or absolute as it was given, to files and whether to take them."""
    import glob

    if any(c in path for c in _MAGIC) and not os.path.exists(path):
        found = sorted(glob.glob(path, recursive=True))
        return (file for m in found for file in (_below(m) if os.path.isdir(m) else [(m, _known(m))]))
    return _below(path)


def _below(path: str, above: tuple[str, ...] = ()) -> Iterator[tuple[str, bool]]:
    """A file as it is; a folder of cells as one; another folder as the files in it, and which of them to take.

    A link to a folder it is in leads nowhere new. A folder that cannot be listed stays: its row says why.
    """
    if not os.path.isdir(path) or is_label_file(path):
        yield path, True
        return
    place = os.path.realpath(path)
    if place in above:
        return
    try:
        entries = None if _is_cells(path) else sorted(os.scandir(path), key=lambda e: e.name)
    except OSError:
        entries = None
    if entries is None:
        yield path, True
        return
    for entry in entries:
        if entry.name.startswith("."):
            continue
        if _is_folder(entry) and not is_label_file(entry.name):
            yield from _below(entry.path, (*above, place))
        else:
            yield entry.path, _known(entry.name)


def _is_folder(entry: os.DirEntry[str]) -> bool:
    """Links are followed; one that leads in a circle is none."""
    try:
        return entry.is_dir()
    except OSError:
        return False


def _known(name: str) -> bool:
    dot = name.rfind(".")  # of most names the suffix begins there, which `splitext` takes its time to say
    if name[dot:].lower() not in _KNOWN:
        return False
    return (dot > 0 and name[dot - 1].isalnum()) or posixpath.splitext(name)[1] != ""


def _is_cells(folder: str) -> bool:
    """Whether a folder holds the cells of one polyhedral mesh: its name ends in "cells", theirs are numbers.

    The numbers alone do not tell: many a data set has them.
    """
    if not Path(folder).absolute().name.lower().endswith("cells"):
        return False
    from voxkernel.polyhedral import is_polyhedral

    return is_polyhedral(folder)


def _printable(name: str) -> str:
    """Name of a file in the table: slashes, and bytes that are no UTF-8 as escapes."""
    name = name if os.sep == "/" else name.replace(os.sep, "/")
    return name if name.isascii() else name.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")


def _is_local(url: str) -> bool:
    """Whether it is a path of this machine; file names may hold what else makes a chain of file systems."""
    return ("://" not in url and ("::" not in url or is_label_file(url))) or os.path.lexists(_stored(url))


def _stored(url: str) -> str:
    """The file of a name that leads into a file of label images: ``cells.h5`` of ``cells.h5::labels``."""
    return url.partition("::")[0] if "://" not in url and is_label_file(url) else url


def is_private(url: str) -> bool:
    """Whether only this process can read it."""
    return url.startswith("memory://")


def with_data(item: Item) -> Item:
    """Put the bytes of a file only this process can read into its item."""
    if item.data is not None or not is_private(item.url):
        return item
    return replace(item, data=_read(item.url))


def content_hash(item: Item) -> str:
    """Name the content of a mesh: SHA-256 of its bytes, of a folder of its names and files; "" if unreadable."""
    if item.data is None and (data := _small_file(item.url)) is not None:
        return hashlib.sha256(data).hexdigest()
    digest = hashlib.sha256()
    try:
        if item.data is None and is_label_file(item.url) and _is_local(item.url):
            _hash_tree(Path(_stored(item.url)), digest)
        elif item.data is None and _is_local(item.url) and os.path.isdir(item.url):
            for name in sorted(os.listdir(item.url)):
                digest.update(name.encode("utf-8", "surrogateescape") + b"\0")
                digest.update(hashlib.sha256(input_file(Path(item.url) / name, OSError).read_bytes()).digest())
        else:
            digest.update(_read(item.url) if item.data is None else item.data)
    except Exception:  # any file system may fail in its own way; the mesh's own reader says how
        return ""
    return digest.hexdigest()


def _small_file(path: str) -> bytes | None:
    """Read a regular file of this machine at once; None for anything else, and for what is better read in pieces."""
    if "://" in path or not _known(path):
        return None
    try:
        file = os.open(path, _READING)
    except OSError:
        return None
    try:
        # What `fstat` says takes twice as long. A pipe has no end to go to, a folder cannot be read.
        size = os.lseek(file, 0, os.SEEK_END)
        if not 0 < size <= 1 << 24:
            return None
        os.lseek(file, 0, os.SEEK_SET)
        data = os.read(file, size)
        return data if len(data) == size else None
    except OSError:
        return None
    finally:
        os.close(file)


def _hash_tree(path: Path, digest: Any) -> None:
    """Take in a file piece by piece, or a folder with all below: a label image may be larger than memory."""
    if path.is_dir():
        for below in sorted(path.iterdir()):
            digest.update(below.name.encode("utf-8", "surrogateescape") + b"\0")
            _hash_tree(below, digest)
        return
    with input_file(path, OSError).open("rb") as stream:
        while piece := stream.read(1 << 24):
            digest.update(piece)


def _read(url: str) -> bytes:
    if _is_local(url):
        return input_file(url, OSError).read_bytes()
    fs, path = optional("fsspec.core").url_to_fs(url)
    return bytes(fs.cat_file(path))


@contextmanager
def local_copy(item: Item, folder: str | None = None) -> Generator[tuple[str, str]]:
    """Give a local path of a mesh and the hash of its content; remote ones are fetched once, to below `folder`."""
    if item.data is None and _is_local(item.url):
        yield item.url, item.known_hash or content_hash(item)
        return
    try:
        data = _read(item.url) if item.data is None else item.data
    except Exception as error:
        raise MeshReadError(f"'{item.name}' cannot be read: {error or type(error).__name__}") from error
    with TemporaryDirectory(prefix="voxkernel-", dir=folder) as own:
        file = Path(own) / f"mesh{item.suffix}"
        file.write_bytes(data)
        yield str(file), hashlib.sha256(data).hexdigest()


def labelled(items: Sequence[Item], labels: Labels | None, views: int | Any) -> tuple[list[Item], list[str]]:
    """Give items their labels and views; also the entries of the label table that no file matched."""
    if labels is None and views == 0:
        return list(items), []
    made: list[Item] = []
    used: set[str] = set()
    for k, item in enumerate(items):
        label, key = (None, None) if labels is None else labels.of(item.name)
        used |= {key} if key else set()
        made.append(Item(item.name, item.url, label, views == "all" or k < views, item.data))
    unmatched = [] if labels is None or labels.table is None else sorted(set(labels.table) - used)
    return made, unmatched
