"""Run by a Python that has `bpy`: what Blender says of the grids of a .vdb file, as JSON on the last line.

Usage: python blender_peer.py FILE.vdb
"""

import json
import sys

import bpy

bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.object.volume_import(filepath=sys.argv[1], align="WORLD", location=(0.0, 0.0, 0.0))
volume = bpy.context.object
grids = volume.data.grids
grids.load()
found = {
    grid.name: {"type": grid.data_type, "transform": [list(row) for row in grid.matrix_object]} for grid in grids
}
graph = bpy.context.evaluated_depsgraph_get()
corners = [list(corner) for corner in volume.evaluated_get(graph).bound_box]
print()
print(json.dumps({"version": bpy.app.version, "grids": found, "corners": corners, "error": grids.error_message}))
