"""Every format the library reads, for the fuzzing."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import fuzz_grids as grids
import fuzz_laws as laws
import fuzz_meshlab as lab
import fuzz_mutations as fm
import fuzz_solids as solids
import fuzz_surfaces as surfaces
import fuzz_tables as tables

__all__ = ["FORMATS", "Format"]


@dataclass
class Format:
    """A kind of file: `read` gives what the file means, as arrays, or raises one of `errors` with one line."""

    suffix: str
    make_seeds: Callable[[], list[bytes]]
    damage: Callable[[Any, bytes], bytes]
    read: Callable[[Path], Any]
    same: Callable[[Any, bytes], bytes] | None = None
    law: Callable[[bytes, Any], None] | None = None  # AssertionError if what was read is not what the file says
    errors: str = "library"  # or "values": a ValueError or FileNotFoundError that says what must be
    warns: str = ""  # words of the only warning there may be

    @cached_property
    def seeds(self) -> list[bytes]:
        """The sound files, made once."""
        return self.make_seeds()


def _text(words=(), openings=()):
    return lambda rng, data: fm.damage_text(rng, data, words, openings)


def _surface(suffix, seeds, damage, same=None, law=None):
    return Format(suffix, seeds, damage, surfaces.read_surface, same, law)


def _lab(suffix, damage, seeds=None, same=None):
    made = seeds or (lambda: lab.written_by_pymeshlab(suffix))
    return Format(suffix, made, damage, lab.read_surface_in_child, same)


def _ply(order):
    return _surface(".ply", lambda: surfaces.ply_seeds(order), surfaces.damage_ply, surfaces.same_ply, laws.ply)


def _vdb(compression):
    return Format(
        ".vdb", lambda: grids.vdb_seeds(compression), grids.damage_vdb, grids.read_vdb_file, warns=": skipped "
    )


def _table(suffix, seeds, damage, read):
    return Format(suffix, seeds, damage, read, errors="values")


_OFF = _text(("OFF", "COFF", "NOFF", "STOFF", "4OFF", "nOFF", "BINARY"))
_OBJ = _text(("v", "f", "vn", "vt", "l", "p", "g", "1/1", "/1", "1//", "\\"))
_STL = _text(("solid", "facet", "normal", "outer", "loop", "vertex", "endloop", "endfacet", "endsolid"))
_FBX = _text(("Geometry", "Vertices", "PolygonVertexIndex", "Model", "C", "a", "*3"), ("{", '"', "A: {"))
_MEDIT = _text(("Vertices", "Tetrahedra", "Hexahedra", "Prisms", "Wedges", "Pyramids", "Triangles", "End", "Dimension"))
_HEDRA = _text(("#", "4"))

FORMATS = {
    "ply_ascii": _ply(""),
    "ply_little": _ply("little"),
    "ply_big": _ply("big"),
    "off": _surface(".off", surfaces.off_seeds, _OFF, surfaces.same_off, laws.off),
    "obj": _surface(".obj", surfaces.obj_seeds, _OBJ, surfaces.same_obj, laws.obj),
    "stl_ascii": _surface(".stl", surfaces.stl_text_seeds, _STL, surfaces.same_stl_text),
    "stl_binary": _surface(".stl", surfaces.stl_binary_seeds, surfaces.damage_stl_binary, surfaces.same_stl_binary),
    "3ds": _lab(".3ds", lab.damage_3ds),
    "3mf": _lab(".3mf", lab.damage_3mf),
    "ctm": _lab(".ctm", lab.damage_ctm, lab.ctm_seeds),
    "dae": _lab(".dae", lab.damage_xml),
    "fbx": _lab(".fbx", _FBX, lab.fbx_seeds),
    "glb": _lab(".glb", lab.damage_glb, lab.glb_seeds),
    "gltf": _lab(".gltf", fm.damage_json_text, lab.gltf_seeds, fm.same_json),
    "wrl": _lab(".wrl", lab.damage_vrml, same=lab.same_vrml),
    "x3d": _lab(".x3d", lab.damage_xml),
    "x3dv": _lab(".x3dv", lab.damage_vrml, lab.x3dv_seeds, lab.same_vrml),
    "hedra": Format(".hedra", solids.hedra_seeds, _HEDRA, solids.read_cells, solids.same_hedra, laws.hedra),
    "mesh": Format(".mesh", solids.medit_seeds, _MEDIT, solids.read_cells, solids.same_medit, laws.medit),
    "vtu": Format(".vtu", solids.vtu_seeds, solids.damage_vtu, solids.read_cells, solids.same_vtu),
    "vtp": _surface(".vtp", surfaces.vtp_seeds, solids.damage_vtu),
    "cell_folder": Format(".off", surfaces.off_seeds, _OFF, solids.read_folder, surfaces.same_off),
    "vdb_none": _vdb("none"),
    "vdb_zip": _vdb("zip"),
    "vdb_blosc": _vdb("blosc"),
    "npz": Format(".npz", grids.npz_seeds, grids.damage_npz, grids.read_npz_file),
    "kernel_npz": Format(".npz", grids.kernel_npz_seeds, grids.damage_npz, grids.read_kernel_npz),
    "report_parquet": _table(".parquet", tables.parquet_seeds, tables.damage_parquet, tables.read_report_parquet),
    "report_rows": _table(".json", tables.rows_seeds, tables.damage_rows, tables.read_report_rows),
    "report_view": _table(".bin", tables.view_seeds, tables.damage_view, tables.read_report_view),
    "labels_csv": _table(".csv", tables.labels_seeds, tables.damage_csv, tables.read_labels_csv),
}
