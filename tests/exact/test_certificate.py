"""Certificates: what they must say, and that no other numbers pass for a proof."""

import json
from dataclasses import replace
from fractions import Fraction

import numpy as np
import oracle
import pytest
import shapes
from hypothesis import given, settings
from hypothesis import strategies as st

from voxkernel.exact import exact_kernel

# one surface of every dimension
BY_DIMENSION = {
    -1: shapes.torus,
    0: shapes.notched_cube,
    1: shapes.saw_prism,
    2: shapes.s_tetromino,
    3: shapes.star_prism,
}


@pytest.mark.parametrize("dimension", BY_DIMENSION)
@pytest.mark.parametrize("filtered", [True, False])
def test_one_certificate_of_every_dimension(dimension, filtered):
    proof = exact_kernel(BY_DIMENSION[dimension]()).certificate
    assert proof.verify(filtered=filtered)
    assert proof.dimension == dimension
    assert proof.kind == {-1: "empty", 3: "solid"}.get(dimension, "flat")
    assert len(proof.points) == {-1: 0, 3: 1}.get(dimension, dimension + 1)
    assert repr(proof).startswith(f"Certificate(kind='{proof.kind}', facet_ids=(")


@settings(max_examples=60)
@given(shapes.integer_meshes(), st.data())
def test_the_oracle_accepts_what_verify_accepts(surface, data):
    """Farkas multipliers and points, checked on the facets' planes as the oracle makes them."""
    vertices, faces = surface
    proof = exact_kernel(surface).certificate
    planes = oracle.corner_planes(vertices, faces)
    assert all(oracle.is_inside(planes, p) for p in proof.points)
    if proof.kind == "solid":
        assert all(oracle.side(p, proof.points[0]) < 0 for p in planes if p is not None)
        return
    assert proof.verify()
    # the multipliers belong to planes scaled as integer_planes gives them: rescale them to the oracle's
    ours = proof.halfspaces.integer_planes(proof.rows)
    theirs = [planes[i] for i in proof.facet_ids]
    unit = proof.halfspaces.lattice_unit
    k = [next(j for j in range(3) if p[j]) for p in theirs]
    weights = [m * Fraction(o[j], t[j]) for m, o, t, j in zip(proof.multipliers, ours, theirs, k, strict=True)]
    assert all(w > 0 for w in weights)
    sums = [sum(w * p[j] for w, p in zip(weights, theirs, strict=True)) for j in range(4)]
    assert sums[:3] == [0, 0, 0]
    assert sums[3] < 0 if proof.kind == "empty" else sums[3] == 0
    assert unit & (unit - 1) == 0
    # any one multiplier changed alone breaks the balance
    i = data.draw(st.integers(0, len(proof.multipliers) - 1))
    changed = list(proof.multipliers)
    changed[i] += data.draw(st.sampled_from([-1, 1, 10**30]))
    assert not replace(proof, multipliers=tuple(changed)).verify()


@pytest.mark.parametrize("dimension", BY_DIMENSION)
def test_nothing_else_passes_for_a_proof(dimension):
    proof = exact_kernel(BY_DIMENSION[dimension]()).certificate
    other = (dimension + 2) % 5 - 1
    assert not replace(proof, dimension=other).verify()
    assert not replace(proof, kind="nothing").verify()
    for kind in {"empty", "flat", "solid"} - {proof.kind}:
        assert not replace(proof, kind=kind).verify()
    if proof.rows:
        assert not replace(proof, multipliers=proof.multipliers[:-1]).verify()
        assert not replace(proof, multipliers=(0, *proof.multipliers[1:])).verify()
        assert not replace(proof, facet_ids=(proof.facet_ids[0] + 1, *proof.facet_ids[1:])).verify()
        assert not replace(proof, rows=(len(proof.halfspaces), *proof.rows[1:])).verify()
        assert not replace(proof, rows=(), facet_ids=(), multipliers=()).verify()
    if proof.points:
        assert not replace(proof, points=proof.points[:-1]).verify()
        assert not replace(proof, points=((Fraction(99),) * 3, *proof.points[1:])).verify()
        assert not replace(proof, points=((Fraction(99),) * 3, *proof.points[1:])).verify(filtered=False)
    if len(proof.points) > 1:  # points of a smaller hull prove less
        assert not replace(proof, points=(proof.points[0],) * len(proof.points)).verify()


def test_a_point_on_the_boundary_does_not_prove_a_solid():
    proof = exact_kernel(shapes.cube()).certificate
    half = Fraction(1, 2)
    for filtered in (True, False):
        assert replace(proof, points=((half, half, half),)).verify(filtered=filtered)
        assert not replace(proof, points=((half, half, Fraction(1)),)).verify(filtered=filtered)
        edge = (half, half, 1 - Fraction(1, 10**100))
        assert replace(proof, points=(edge,)).verify(filtered=filtered)


def test_the_domain_s_planes_count_down_from_minus_one():
    away = np.concatenate([np.eye(3), -np.eye(3)]), np.array([5, 5, 5, -3, 5, 5.0])
    kernel = exact_kernel(shapes.cube(), domain=away)
    assert kernel.dimension == -1
    assert kernel.certificate.verify()
    assert -1 - 3 in kernel.certificate.facet_ids  # plane 3 of the domain: x >= 3
    assert kernel.unclipped_certificate.kind == "solid"
    assert kernel.unclipped_certificate.verify()


@pytest.mark.parametrize("dimension", BY_DIMENSION)
def test_plain_numbers_survive_json(dimension):
    proof = exact_kernel(BY_DIMENSION[dimension]()).certificate
    data = json.loads(json.dumps(proof.to_dict()))
    assert data["kind"] == proof.kind
    assert data["facet_ids"] == list(proof.facet_ids)
    assert tuple(int(m) for m in data["multipliers"]) == proof.multipliers
    assert tuple(tuple(Fraction(v) for v in p) for p in data["points"]) == proof.points


@pytest.mark.parametrize("turn", [False, True])
def test_unbounded_flat_kernels_are_proven_without_their_domain(turn, rng):
    """Both sides of a triangle: the kernel is its whole plane; two planes that cross: a line."""
    front = [(0, 1, 2), (0, 2, 1)]
    for vertices, faces, dimension in (
        ([(0, 0, 0), (3, 0, 0), (0, 2, 0)], front, 2),
        ([(0, 0, 0), (3, 0, 0), (0, 2, 0), (0, 0, 4)], [*front, (0, 1, 3), (0, 3, 1)], 1),
        ([(0, 0, 0), (3, 0, 0), (0, 2, 0), (0, 0, 4)], [*front, (0, 1, 3), (0, 3, 1), (0, 2, 3), (0, 3, 2)], 0),
    ):
        points, triangles = shapes.mesh(vertices, faces)
        if turn:
            points = points @ shapes.quarter_turns()[7].T + [1, 2, 3]
        kernel = exact_kernel((points, triangles))
        assert kernel.unclipped_dimension == dimension
        assert kernel.dimension == dimension
        assert kernel.unclipped_certificate.verify(filtered=False)
        assert kernel.is_bounded == (dimension == 0)
        assert kernel.cut_by_domain == (dimension > 0)
        assert (kernel.domain is None) == (dimension == 0)
