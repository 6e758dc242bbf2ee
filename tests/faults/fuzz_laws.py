"""What an accepted file of text says about itself must be what was read: damage may be refused, but never guessed away.

Each law reads the damaged bytes in a way of its own; it says nothing where it does not understand them.
"""

import re

PLY_HEADER = {"ply", "format", "comment", "obj_info", "element", "property", "end_header"}


def _one(lines, name):
    """The number of the only line about an element."""
    counts = [words[2:] for words in lines if words[:2] == ["element", name]]
    assert len(counts) <= 1, f"{len(counts)} sections of element {name}, and one of them was taken"
    return int(counts[0][0]) if counts else 0


def ply(data, meaning):
    vertices, _, _, n_facets = meaning
    head = re.split(rb"[\r\n][ \t]*end_header", data)[0].decode("ascii", "replace")  # a comment may hold that word too
    ends = re.split(r"\r\n|\r|\n" if "\n" not in head else r"\r?\n", head)  # a single \r ends lines in old files only
    lines = [words for words in (line.split() for line in ends) if words]
    unknown = [words[0] for words in lines if words[0] not in PLY_HEADER]
    assert not unknown, f"unknown header words {unknown[:3]} were passed over"
    assert sum(words[0] == "format" for words in lines) == 1, "not one format line"
    for name, n in (("vertex", len(vertices)), ("face", n_facets[0])):
        assert _one(lines, name) == n, f"the header says {_one(lines, name)} of element {name}, read were {n}"
    counts = [int(words[2]) for words in lines if words[0] == "element"]
    assert min(counts) >= 0, f"an element that is there {min(counts)} times"


def off(data, meaning):
    vertices, _, _, n_facets = meaning
    words = re.sub(r"#[^\r\n]*", "", data.decode("ascii", "replace")).split()
    counts = [int(word) for word in words[1:3]]
    assert counts == [len(vertices), n_facets[0]], f"the file says {counts}, read were {len(vertices), n_facets[0]}"


def obj(data, meaning):
    vertices, _, facet_ids, n_facets = meaning
    if b"\\" in data or b"#" in data.replace(b"# ", b"", 1):
        return
    rows = [line.split() for line in data.decode("utf-8", "replace").splitlines()]
    n_vertices = sum(words[:1] == ["v"] for words in rows)
    faces = [words[1:] for words in rows if words[:1] == ["f"]]
    assert n_vertices == len(vertices), f"{n_vertices} lines of vertices, read were {len(vertices)}"
    assert len(faces) == n_facets[0], f"{len(faces)} lines of faces, read were {n_facets[0]}"
    for face in faces:
        wrong = [word for word in face if re.fullmatch(r"[-+]?\d.*", word) is None]
        assert not wrong, f"a corner {wrong[0]!r} without a vertex was taken"
    for k, face in enumerate(faces):
        if len(face) == 3:
            assert (facet_ids == k).sum() == 1, f"face {k} of 3 corners is {(facet_ids == k).sum()} triangles"


def hedra(data, meaning):
    vertices, face_offsets, _, cell_offsets, _ = meaning
    lines = [line for line in data.decode("ascii", "replace").splitlines() if line.strip()]
    lines = [line for line in lines if not line.lstrip().startswith("#")]
    counts = [int(word) for word in lines[0].split()]
    found = [len(vertices), len(face_offsets) - 1, len(cell_offsets) - 1]
    assert counts == found, f"the file says {counts}, read were {found}"
    assert len(lines) == 1 + sum(counts), f"{len(lines) - 1 - sum(counts)} rows behind the last were passed over"


def medit(data, meaning):
    words = re.sub(rb"#[^\r\n]*", b"", data).lower().split()
    sections = [at for at, word in enumerate(words) if word == b"vertices"]
    assert len(sections) == 1, f"{len(sections)} sections Vertices, and one of them was taken"
    n = int(words[sections[0] + 1])
    assert n == len(meaning[0]), f"the file says {n} vertices, read were {len(meaning[0])}"
