"""Independent of the library's hull: a cube cut by half-spaces in rational arithmetic, one after the other."""

from fractions import Fraction

from voxkernel.exact.rational_clipping import RationalPolytope, _between, _side


def clip_polyhedron(rows, reach):
    """Intersect half-spaces with a cube of half edge `reach`; the result must have a volume."""
    start = [tuple(reach if (i >> k) & 1 else -reach for k in range(3)) for i in range(8)]
    vertices = list(start)
    faces = [
        (-1, f) for f in ([0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6])
    ]
    alive = list(range(8))
    for r, (normal, bound) in enumerate(rows):
        side = {i: _side(normal, bound, vertices[i]) for i in alive}
        if not any(s > 0 for s in side.values()):
            continue
        cuts = {}
        fresh = []
        follow = {}  # around the new face: from a vertex to the one after it
        for row, ring in faces:
            kept = []
            for i, j in zip(ring, ring[1:] + ring[:1], strict=True):
                if side[i] <= 0:
                    kept.append(i)
                if side[i] * side[j] < 0:
                    key = (min(i, j), max(i, j))
                    if key not in cuts:
                        cuts[key] = len(vertices)
                        vertices.append(_between(vertices[i], vertices[j], side[i], side[j]))
                        side[cuts[key]] = Fraction(0)
                    kept.append(cuts[key])
            if len(kept) >= 3 and any(side[i] < 0 for i in kept):
                fresh.append((row, kept))
                for i, j in zip(kept, kept[1:] + kept[:1], strict=True):
                    if side[i] == 0 and side[j] == 0:
                        follow[j] = i
        ring = []
        if follow:
            current = first = next(iter(follow))
            while True:
                ring.append(current)
                current = follow[current]
                if current == first:
                    break
        if len(ring) >= 3:
            fresh.append((r, ring))
        faces = fresh
        alive = sorted({i for _, f in faces for i in f})
    order = {v: k for k, v in enumerate(alive)}
    return RationalPolytope([vertices[i] for i in alive], [(row, [order[i] for i in f]) for row, f in faces])
