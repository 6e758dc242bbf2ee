"""`SparseGrid` in, .vdb file out, and back."""

from voxkernel.vdb.vdb_file import VdbFile, read_vdb, write_vdb

__all__ = [
    "VdbFile",
    "read_vdb",
    "write_vdb",
]
