"""
A failed star and the 4 facets that prove it
============================================

A torus is not star-shaped. The proof is four facets (red): the arrows point to their inner sides, and no point is on
the inner side of all four. Anyone can check that in exact arithmetic.
"""

from fractions import Fraction

import voxkernel
from voxkernel.demo_shapes import torus
from voxkernel.pictures import surface_picture

mesh = voxkernel.as_mesh(torus())
kernel = voxkernel.exact_kernel(mesh)
surface_picture("failed_star.png", mesh, kernel, title="A torus", size=(1300, 900))

# %%
# The proof
# ---------
# By Helly's theorem, four half-spaces of space that have no common point are enough, however many facets there are.
# Farkas' lemma gives weights: the normals cancel, and the offsets add up to less than zero.
proof = kernel.certificate
print(proof)
print("facets     ", proof.facet_ids)
print("verify()   ", proof.verify())

# %%
# Checked by hand
# ---------------
# With Python's own fractions, from the coordinates as they are stored: for any point x, the sum of
# l (n . x - d) is the constant -sum(l d) > 0. So at least one of the four terms is positive, whatever x is.
corners = [[[Fraction(v) for v in mesh.vertices[i].tolist()] for i in mesh.faces[facet]] for facet in proof.facet_ids]


def plane(a, b, c):
    """The facet's plane n . x = d, exactly."""
    u, v = ([q - p for p, q in zip(a, other, strict=True)] for other in (b, c))
    n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
    return n, sum(p * q for p, q in zip(n, a, strict=True))


planes = [plane(*triangle) for triangle in corners]
pairs = list(zip(proof.multipliers, planes, strict=True))
sum_of_normals = [sum(weight * normal[k] for weight, (normal, _) in pairs) for k in range(3)]
sum_of_offsets = sum(weight * offset for weight, (_, offset) in pairs)
print("sum of l n =", [str(v) for v in sum_of_normals])
print("sum of l d < 0:", sum_of_offsets < 0)
assert sum_of_normals == [0, 0, 0]
assert sum_of_offsets < 0 < min(proof.multipliers)

# %%
# Limits
# ------
# The certificate says that these facets exclude each other, not that they are wrong: on a scan they are often a few
# noisy triangles, on a torus any four around the ring. How much of a surface is in the way is another number,
# `best_center`. See :doc:`/theory/certificates` and :doc:`/howto/reading_a_certificate`.
#
# Sources: E. Helly, 1923; J. Farkas, 1902; see :doc:`/references`.
