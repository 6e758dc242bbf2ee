"""Run directories made by formula, for the tests of the report; no mesh is read."""

import json
import zlib

import numpy as np

from voxkernel.report.rows import from_index, open_run_index
from voxkernel.run_table import open_run, write_bytes, write_part

HOSTILE = (
    "<script>alert(1)</script>.ply",
    '"><img src=x onerror="document.title=\'owned\'">.ply',
    'it\'s `quoted` "twice" \\ and back.ply',
    "</script><svg onload=alert(2)>.ply",
    "line\u2028and paragraph\u2029separators.ply",
    "right to \u202egnp.ylp",
    "two\nlines\r\nand a tab\t.ply",
    "very " + "long " * 400 + "name.ply",
    "pipe | `tick` | [x](javascript:alert(3)) ![i](http://example.com/i.png) @someone #1 ~~no~~.ply",
    "{{ 7*7 }}{% raw %}.ply",
    "<!--<script>.ply",
    '=HYPERLINK("http://example.com","click").ply',
    "nul\x00 bell\x07 escape\x1b[31m.ply",
    "\u00fcml\u00e4ut \u4e2d\u6587 \u0645\u0631\u062d\u0628\u0627 \U0001f600.ply",
    "&lt;b&gt;&amp;.ply",
    "www.example.com.ply",
)
TOLERANCES = np.linspace(0.0, 0.5, 26).tolist()


def load_rows(run):
    """The rows of a run as a report has them."""
    return from_index(open_run_index(str(run)))


def png(width=64, height=48, color=(38, 120, 168)):
    """A plain PNG, without an imaging library."""

    def chunk(kind, data):
        return len(data).to_bytes(4, "big") + kind + data + zlib.crc32(kind + data).to_bytes(4, "big")

    line = b"\0" + bytes(color) * width
    header = width.to_bytes(4, "big") + height.to_bytes(4, "big") + b"\x08\x02\0\0\0"
    body = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(line * height)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body


def octahedron(scale=1.0, middle=(0.0, 0.0, 0.0)):
    eye = np.eye(3)
    faces = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]
    points = np.stack([eye[0], eye[1], eye[2], -eye[0], -eye[1], -eye[2]]) * scale + middle
    return points.astype(np.float32), np.array(faces, dtype=np.int32)


def surface_row(file, rng, label="", kind="star-shaped", **more):
    """A row as an evaluation would write it; the numbers only look like real ones."""
    star = kind == "star-shaped"
    ratio = float(rng.beta(2, 5)) if star else 0.0
    defect = 0.0 if star or kind == "degenerate" else float(10 ** rng.uniform(-4, -0.4))
    start = ratio if star else 0.0
    profile = 1 - (1 - start) * np.exp(-np.maximum(0, np.array(TOLERANCES) - defect) * rng.uniform(2, 6))
    center = rng.normal(size=3) * 0.05
    row = {
        "file": file, "label": label, "status": "ok", "reason": "",
        "content_hash": f"{zlib.crc32(repr(file).encode()):08x}", "settings_hash": "s1",
        "settings": json.dumps({"domain": None, "relaxed": True}),
        "versions": json.dumps({"voxkernel": "0.1.0", "numpy": "2.0"}), "finished": "2026-11-22T08:00:00Z",
        "seconds": float(rng.lognormal(-2, 0.5)), "seconds_exact": 0.01, "seconds_read": 0.002,
        "n_vertices": 2502, "n_faces": 5000, "n_facets": 5000, "n_components": 1, "n_boundary_edges": 0,
        "n_nonmanifold_edges": 0, "n_degenerate": 0, "genus": 0, "is_closed": True, "is_oriented": True,
        "is_outward": True, "area": 4.2, "enclosed_volume": 1.1, "diagonal": 2.3, "verdict": kind,
        "verdict_reason": "" if star else "no point is on the inner side of 4 facets",
        "dimension": {"star-shaped": 3, "degenerate": 2}.get(kind, -1), "ratio": ratio, "volume": ratio * 1.1,
        "volume_lower": ratio * 1.1, "volume_upper": ratio * 1.1, "reference_volume": 1.1,
        "clearance": 0.1 if star else None, "reference": "enclosed volume", "domain": None,
        "certificate_kind": "point" if star else "facets", "certificate_facets": [] if star else [1, 20, 300, 4000],
        "certificate_verified": True, "notes": [], "violation_lower": defect * 0.99, "violation_upper": defect,
        "star_center_x": center[0], "star_center_y": center[1], "star_center_z": center[2],
        "profile_tolerances": TOLERANCES, "profile_shares": profile.tolist(),
        "visible_fraction": min(1.0, 1 - defect * float(rng.uniform(1, 1.5))), "thumbnail": "", "view": "",
    }  # fmt: skip
    return {**row, **more}


def failed_row(file, reason="file is not a mesh: 12 bytes", label="", **more):
    return {"file": file, "label": label, "status": "failed", "reason": reason, "seconds": 0.01, "settings_hash": "s1",
            "thumbnail": "", "view": "", **more}  # fmt: skip


def cell_row(file, cell, rng, **more):
    share = float(rng.uniform(0.1, 1.0))
    row = surface_row(file, rng)
    return {**row, "cell": cell, "ratio": share, "volume_share": share, "inradius": 0.02,
            "inradius_over_diameter": share * 0.3, "n_facets": 14, **more}  # fmt: skip


def write_run(run, rows, parts=1):
    fs, path = open_run(str(run))
    for k in range(parts):
        write_part(fs, path, rows[k::parts])
    return str(run)


def add_thumbnail(run, row, data=None):
    fs, path = open_run(str(run))
    row["thumbnail"] = f"thumbnails/{row['content_hash']}.png"
    write_bytes(fs, f"{path}/{row['thumbnail']}", png() if data is None else data)
    return row


def add_view(run, row, **arrays):
    import io

    vertices, faces = octahedron()
    inner, inner_faces = octahedron(0.3)
    content = {"vertices": vertices, "faces": faces, "kernel_vertices": inner, "kernel_faces": inner_faces, **arrays}
    stream = io.BytesIO()
    np.savez(stream, **content)
    fs, path = open_run(str(run))
    row["view"] = f"views/{row['content_hash']}.npz"
    write_bytes(fs, f"{path}/{row['view']}", stream.getvalue())
    return row


def large_run(run, n, rng, labels=("convex", "star", "near-star", "non-star")):
    """`n` rows with 1 % failed, hostile names among them, some thumbnails and views."""
    rows = []
    for i in range(n - len(HOSTILE)):
        label = labels[i % len(labels)]
        kind = "star-shaped" if label in ("convex", "star") else "not star-shaped"
        if i % 97 == 5:
            kind = "degenerate"
        name = f"set/{label}/{i:05d}.ply"
        rows.append(failed_row(name, label=label) if i % 100 == 7 else surface_row(name, rng, label, kind))
    rows += [surface_row(name, rng, labels[k % len(labels)]) for k, name in enumerate(HOSTILE)]
    for row in rows[:40]:
        if row["status"] == "ok":
            add_thumbnail(run, row)
            add_view(run, row)
    return write_run(run, rows, parts=3)
