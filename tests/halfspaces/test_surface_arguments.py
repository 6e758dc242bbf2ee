"""What `surface`, `facets`, `domain` and `frame` stand for: one way in, the same for every function."""

import inspect
import re
from pathlib import Path

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel.exact import KernelPolytope
from voxkernel.halfspaces import HalfSpaces
from voxkernel.halfspaces.surface_arguments import DEFAULT_DOMAINS, EXACT, REGISTRATION, RELAXED, surface_argument
from voxkernel.registration import prepare_surface

PAGE = Path(__file__).resolve().parents[2] / "docs" / "domains.md"
CUBE = shapes.cube()
CUBE_PLANES = HalfSpaces.from_mesh(voxkernel.as_mesh(CUBE))
OPEN = shapes.height_field(n=4)
TORUS = shapes.torus()
POINT = [[0.1, 0.2, 0.3]]


def called(name, surface, **options):
    """Call a public function of a surface with as little work as it allows."""
    needed = {
        "violation": {"points": POINT}, "visible_fraction": {"point": POINT[0], "n_samples": 100},
        "voxel_kernel": {"depth": 3}, "voxel_kernels": {"depth": 3, "tolerances": [0.2]},
        "violation_grid": {"depth": 3, "tolerance": 0.2}, "defect_profile": {"depth": 3, "tolerances": [0.2]},
        "spherical_map": {"center": "deepest"},
    }  # fmt: skip
    return getattr(voxkernel, name)(surface, **{**needed.get(name, {}), **options})


def takes(name, word):
    return word in inspect.signature(getattr(voxkernel, name)).parameters


FUNCTIONS = [name for name in voxkernel.__all__ if inspect.isfunction(getattr(voxkernel, name))]
TAKES_FACETS = [name for name in FUNCTIONS if takes(name, "facets")]
WANTS_DOMAIN = {"best_center", "defect_profile", "violation_grid", "voxel_kernels"}
WANTS_MESH = {"as_mesh", "guards", "spherical_map", "starshapeness", "visible_fraction"}
WRONG = [
    ([-1], ValueError, r"`facets` must be in 0\.\.(5|11); got -1"),
    ([999], ValueError, r"`facets` must be in 0\.\.(5|11); got 999"),
    ([0.5], TypeError, "`facets` must be an array of integers; got dtype float64"),
    (["a"], TypeError, "`facets` must be an array of integers; got dtype <U1"),
    ([[0, 1]], ValueError, r"`facets` must have shape \(n,\); got \(1, 2\)"),
    ([[0], [0, 1]], ValueError, r"`facets` must have shape \(n,\); got rows of different lengths"),
    ([True, False], ValueError, r"`facets` as a mask must have shape \((6|12),\); got \(2,\)"),
    ([], ValueError, "`facets` must (leave a facet|name at least one)"),
]


def test_who_takes_facets():
    assert {"exact_kernel", "voxel_kernel", "violation", *WANTS_DOMAIN, *WANTS_MESH} == set(TAKES_FACETS)


@pytest.mark.parametrize("name", TAKES_FACETS)
@pytest.mark.parametrize(("facets", "error", "match"), WRONG, ids=[str(w[0]) for w in WRONG])
def test_wrong_facets_are_one_line_of_every_function(name, facets, error, match):
    domain = {"domain": (np.r_[np.eye(3), -np.eye(3)], np.ones(6))} if name in WANTS_DOMAIN else {}
    for surface in (CUBE,) if name in WANTS_MESH else (CUBE, CUBE_PLANES):
        with pytest.raises(error, match=match) as caught:
            called(name, surface, facets=facets, **domain)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", sorted(WANTS_MESH))
def test_half_spaces_are_no_mesh(name):
    with pytest.raises(TypeError, match="`mesh` must be a path"):
        called(name, CUBE_PLANES)


@pytest.mark.parametrize("facets", [[0, 1, 4], [4, 0, 1, 0], np.isin(np.arange(12), [0, 1, 4])], ids=str)
def test_facets_of_a_mesh_and_of_its_half_spaces_agree(facets):
    one, two = surface_argument(CUBE, facets), surface_argument(CUBE_PLANES, facets)
    assert two.mesh is None
    assert one.halfspaces.facet_ids.tolist() == two.halfspaces.facet_ids.tolist() == [0, 1, 4]
    assert one.halfspaces.normals.tolist() == two.halfspaces.normals.tolist()
    domain = np.r_[np.eye(3), -np.eye(3)], np.full(6, 3.0)
    volumes = [voxkernel.exact_kernel(s, facets=facets, domain=domain).volume for s in (CUBE, CUBE_PLANES)]
    assert volumes[0] == pytest.approx(volumes[1], rel=1e-12)


# ---------------------------------------------------------------- default domains


def kind_of(result):
    """Where a result says it was looked for; "" is everywhere."""
    kernel = getattr(result, "kernel", result)
    domain = getattr(kernel, "domain", None)
    return "" if domain is None else domain.kind


def test_every_function_of_a_surface_stands_in_the_table():
    listed = {re.split("[ ,]", text)[0] for row in DEFAULT_DOMAINS for text in row.functions}
    takes_domain = {n for n in FUNCTIONS if takes(n, "domain")}
    assert takes_domain | {"register", "register_many", "prepare_surface"} <= listed
    # Of `label_stars` it says whether to make a surface of each object.
    assert {n for n in FUNCTIONS if takes(n, "surface")} - {"label_stars"} <= listed
    assert {text for row in (EXACT, RELAXED) for text in row.functions if " " not in text} <= takes_domain


@pytest.mark.parametrize("name", ["exact_kernel", "voxel_kernel", "starshapeness", "spherical_map"])
def test_default_domains_of_exact_kernels(name):
    assert kind_of(called(name, CUBE)) == EXACT.closed == ""
    assert kind_of(called(name, OPEN)) == EXACT.opened == "ball"


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("voxel_kernel", {"tolerance": 0.3}),
        ("voxel_kernel", {"margin": 0.1}),
        ("voxel_kernels", {}),
        ("voxel_kernels", {"tolerances": None, "margins": [0.1]}),
        ("defect_profile", {}),
        ("best_center", {"gap": 0.1}),
    ],
)
def test_default_domains_of_relaxed_kernels(name, options):
    found = [called(name, surface, **options) for surface in (TORUS, OPEN)]
    kinds = [kind_of(f[0] if isinstance(f, tuple) else f) for f in found]
    assert kinds == [RELAXED.closed, RELAXED.opened] == ["hull", "ball"]
    with pytest.raises(ValueError, match="`domain` must be given for half-spaces; got None"):
        called(name, CUBE_PLANES, **options)


def test_default_domain_of_the_field():
    default, hull, ball = (
        called("violation_grid", TORUS, domain=d, tolerance=1.0).active_voxel_count for d in (None, "hull", "ball")
    )
    assert default == hull != ball


def test_default_domain_of_registration():
    closed = prepare_surface(shapes.icosphere(2), margins=[0.1])
    assert closed.kernels[0].domain.kind == REGISTRATION.closed == REGISTRATION.opened == "ball"


def test_exact_half_spaces_need_no_domain():
    kernel = voxkernel.exact_kernel(CUBE_PLANES)
    assert isinstance(kernel, KernelPolytope)
    assert EXACT.half_spaces == kind_of(kernel) == ""


def test_a_closed_surface_in_one_plane_has_the_ball():
    vertices = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    flat = surface_argument((vertices, [(0, 1, 2), (0, 2, 3), (0, 2, 1), (0, 3, 2)]))
    assert flat.bounded_domain(None).kind == "ball"


def test_a_domain_that_is_given_wins():
    for row in DEFAULT_DOMAINS:
        assert surface_argument(CUBE).domain("box", row).kind == "box"


def test_axes():
    box = surface_argument(shapes.box((0, 0, 0), (1, 5, 2)))
    assert box.axes("world").tolist() == np.eye(3).tolist()
    assert np.abs(box.axes("principal")) == pytest.approx(np.eye(3)[[1, 2, 0]], abs=1e-12)
    assert box.own_axes().tolist() == box.axes("principal").tolist()
    assert surface_argument(CUBE_PLANES).own_axes().tolist() == np.eye(3).tolist()
    with pytest.raises(ValueError, match="`frame` must be 'world' for half-spaces; got 'principal'"):
        surface_argument(CUBE_PLANES).axes("principal")
    with pytest.raises(ValueError, match="`frame` must be one of 'world', 'principal'; got 'own'"):
        box.axes("own")


def test_the_page_shows_the_table():
    shown = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("| `")]
    assert shown == [page_row(row) for row in DEFAULT_DOMAINS]


def page_row(row):
    functions = ", ".join(re.sub(r"^(\w+),? ?(.*)$", lambda m: f"`{m[1]}`" + (f" ({m[2]})" if m[2] else ""), f)
                          for f in row.functions)  # fmt: skip
    kinds = [f'`"{kind}"`' if kind else "none" for kind in (row.closed, row.opened)]
    return f"| {functions} | {' | '.join(kinds)} | {row.half_spaces or 'none'} | {row.why} |"
