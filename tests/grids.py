"""Random sparse grids and what they hold, worked out by loops that share no code with the library."""

import dataclasses

import numpy as np

from voxkernel.grid import SparseGrid, leaf_bits

LOW, HIGH = -32, 31  # the box random grids live in, both included
BOX = [[LOW] * 3, [HIGH] * 3]
FULL = 2**64 - 1


def random_grid(seed, *, has_values=False, n_cells=12, background=0.0):
    """Tiles of three sizes and leaves (empty, sparse, dense, full) that never overlap, around the origin."""
    rng = np.random.default_rng(seed)
    free = np.ones((8, 8, 8), dtype=bool)
    tiles, log2s, leaves, masks = [], [], [], []
    for _ in range(n_cells):
        log2 = int(rng.choice([0, 0, 3, 4, 5]))
        edge = 1 << max(log2 - 3, 0)
        at = rng.integers(0, 8 // edge, 3) * edge
        region = tuple(slice(a, a + edge) for a in at)
        if not free[region].all():
            continue
        free[region] = False
        corner = at * 8 + LOW
        if log2:
            tiles.append(corner)
            log2s.append(log2)
        else:
            leaves.append(corner)
            masks.append(leaf_bits.pack(rng.random((1, 8, 8, 8)) < rng.choice([0.0, 0.02, 0.7, 1.0]))[0])
    values = {}
    if has_values:
        choice = np.array([0.0, 1.5, -2.0], dtype=np.float32)
        leaf_values = rng.choice(choice, (len(leaves), 512))
        leaf_values[rng.random(len(leaves)) < 0.3] = 1.5
        values = {
            "tile_values": rng.choice(choice, len(tiles)),
            "leaf_values": leaf_values,
            "background": background,
        }
    return SparseGrid.from_tiles_and_leaves(
        np.array(tiles, dtype=np.int64).reshape(-1, 3),
        np.array(log2s, dtype=np.int8),
        np.array(leaves, dtype=np.int64).reshape(-1, 3),
        np.array(masks, dtype=np.uint64).reshape(-1, 8),
        **values,
    )


def dense_mask(grid):
    """Activity in the box, by a loop over cells that shares no code with the library."""
    out = np.zeros((64, 64, 64), dtype=bool)
    for corner, log2 in zip(grid.tile_ijk, grid.tile_log2, strict=True):
        x, y, z = corner - LOW
        edge = 1 << int(log2)
        out[x : x + edge, y : y + edge, z : z + edge] = True
    for corner, mask in zip(grid.leaf_ijk, grid.leaf_mask, strict=True):
        for x in range(8):
            word = int(mask[x])
            for bit in range(64):
                if word >> bit & 1:
                    out[tuple(corner - LOW + (x, bit >> 3, bit & 7))] = True
    return out


def dense_values(grid):
    out = np.full((64, 64, 64), grid.background, dtype=np.float32)
    for corner, log2, value in zip(grid.tile_ijk, grid.tile_log2, grid.tile_values, strict=True):
        x, y, z = corner - LOW
        edge = 1 << int(log2)
        out[x : x + edge, y : y + edge, z : z + edge] = value
    for corner, values in zip(grid.leaf_ijk, grid.leaf_values, strict=True):
        x, y, z = corner - LOW
        out[x : x + 8, y : y + 8, z : z + 8] = values.reshape(8, 8, 8)
    return out


def check_valid(grid):
    """The constructor's checks hold for results that skipped them."""
    again = dataclasses.replace(grid)
    assert again == grid
    for name in ("tile_ijk", "tile_log2", "leaf_ijk", "leaf_mask"):
        np.testing.assert_array_equal(getattr(again, name), getattr(grid, name))
        assert not getattr(grid, name).flags.writeable


def random_frame(seed):
    """Origin and linear part: sometimes scaled only, sometimes any regular matrix."""
    rng = np.random.default_rng(seed)
    origin = rng.normal(size=3) * 100
    kind = rng.integers(3)
    if kind == 0:
        return {"origin": origin, "linear": np.eye(3) * rng.uniform(0.01, 3)}
    if kind == 1:
        return {"origin": origin, "linear": np.diag(rng.uniform(0.01, 3, 3))}
    return {"origin": origin, "linear": np.linalg.qr(rng.normal(size=(3, 3)))[0] * rng.uniform(0.1, 2)}


def with_inactive_tiles(grid, seed):
    """A float grid plus inactive tiles in some of its free 8^3 places."""
    rng = np.random.default_rng(seed)
    taken = dense_mask(grid)
    for corner in grid.leaf_ijk:
        x, y, z = corner - LOW
        taken[x : x + 8, y : y + 8, z : z + 8] = True
    free = np.argwhere(~taken.reshape(8, 8, 8, 8, 8, 8).any(axis=(1, 3, 5)))
    chosen = free[rng.random(len(free)) < 0.2]
    return dataclasses.replace(
        grid,
        inactive_ijk=chosen * 8 + LOW,
        inactive_log2=np.full(len(chosen), 3),
        inactive_values=rng.choice([-grid.background, 7.0], len(chosen)),
    )
