"""Guards, their certificate, pieces and bound; beside a convex decomposition, for what a user gets of each.

Rows say in their case what came out: guards and shares, pieces, the bound. `coacd` where it is installed.
"""

from importlib.util import find_spec

import pytest

import voxkernel
from voxkernel.demo_shapes import comet, torus
from voxkernel.guarding.certificate import certified_parts, middles_of
from voxkernel.guarding.sight import look_at
from voxkernel.halfspaces import HalfSpaces

SHAPES = {
    "torus 1.5k": lambda: torus(n_major=48, n_minor=16),
    "torus 31k": lambda: torus(n_major=160, n_minor=96),
    "torus 102k": lambda: torus(n_major=320, n_minor=160),
    "comet": comet,
}


@pytest.mark.parametrize("name", SHAPES)
def test_guards_and_certificate(side_by_side, name):
    mesh = SHAPES[name]()
    found = voxkernel.guards(mesh)
    sight = look_at(mesh, HalfSpaces.from_mesh(mesh), "inside", 1)
    points = sight.to_local(found.points)
    middles = sight.first_seen(points, middles_of(sight))
    case = f"{name}: {len(mesh.faces)} facets, {len(found)} guards, seen {found.seen:.4f}, proven {found.certified:.4f}"
    side_by_side(
        case,
        {
            "guards": lambda: voxkernel.guards(mesh),
            "certificate": lambda: certified_parts(sight, points, middles),
            "star_cover": lambda: voxkernel.star_cover(found),
        },
        rounds=2,
    )


@pytest.mark.parametrize("name", ["torus 1.5k", "comet"])
def test_bound(side_by_side, name):
    mesh = SHAPES[name]()
    found = voxkernel.guards(mesh, bound=True)
    side_by_side(
        f"{name}: {len(found)} guards, at least {found.at_least}",
        {"with bound": lambda: voxkernel.guards(mesh, bound=True), "without": lambda: voxkernel.guards(mesh)},
        rounds=1,
    )


@pytest.mark.parametrize("name", ["torus 1.5k", "comet"])
def test_beside_a_convex_decomposition(side_by_side, name):
    if find_spec("coacd") is None:
        pytest.skip("coacd is not installed")
    import coacd

    coacd.set_log_level("error")
    mesh = SHAPES[name]()
    found = side_by_side(
        f"{name}: star-shaped pieces and convex ones",
        {
            "voxkernel": lambda: voxkernel.star_cover(voxkernel.guards(mesh)),
            "coacd": lambda: coacd.run_coacd(coacd.Mesh(mesh.vertices, mesh.faces)),
        },
        rounds=1,
    )
    print(name, {rival: f"{len(result)} pieces" for rival, (_, result) in found.items()})
    assert found["voxkernel"][1].verify()
