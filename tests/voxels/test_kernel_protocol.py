"""What polytopes and grids have in common, exact answers of both, and kernel grids as files."""

import inspect
import json
from fractions import Fraction

import numpy as np
import pytest
import shapes
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

import voxkernel
from voxkernel.cli.main import main
from voxkernel.errors import GridReadError
from voxkernel.grid import SparseGrid, read_npz, write_npz
from voxkernel.mesh import as_mesh

NAMES = {
    "dimension", "is_empty", "domain", "volume", "volume_bounds", "contains", "classify", "to_points", "to_mesh",
    "to_dict", "write", "plot",
}  # fmt: skip
CUBE = shapes.cube()
TILTED = Rotation.from_rotvec([0.3, 0.5, -0.7]).as_matrix()


def convex_body(offset, n=40):
    """Corners on a tilted ellipsoid, rounded where they are: the kernel of a convex body is the body."""
    directions = np.random.default_rng(5).normal(size=(n, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    points = (directions * [3, 2, 1]) @ TILTED.T
    faces = ConvexHull(points).simplices.astype(np.int64)
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0
    faces[inward] = faces[inward][:, ::-1]
    return as_mesh((points + offset * np.array([1.0, -0.6, 0.3]), faces))


def exact_cells(grid, points):
    """Positions in voxels, in rational arithmetic, by Cramer's rule."""
    origin = [Fraction(v) for v in grid.origin.tolist()]
    columns = [[Fraction(v) for v in column] for column in grid.linear.T.tolist()]

    def det(a, b, c):
        x, y, z = (a[i] * b[j] - a[j] * b[i] for i, j in ((1, 2), (2, 0), (0, 1)))
        return x * c[0] + y * c[1] + z * c[2]

    whole = det(*columns)
    for point in points.tolist():
        d = [Fraction(v) - o for v, o in zip(point, origin, strict=True)]
        yield [det(*(d if k == j else columns[j] for j in range(3))) / whole for k in range(3)]


def members():
    return {name for name, _ in inspect.getmembers(voxkernel.Kernel) if not name.startswith("_")}


@pytest.mark.parametrize("make", [shapes.cube, shapes.two_boxes, lambda: shapes.s_tetromino(0.0)])
def test_both_fulfil_the_protocol(make, tmp_path):
    assert members() == NAMES
    exact, grid = voxkernel.exact_kernel(make()), voxkernel.voxel_kernel(make(), depth=4)
    for kernel in (exact, grid):
        assert kernel.is_empty == (exact.dimension < 0)
        assert kernel.dimension == exact.dimension
        low, high = kernel.volume_bounds
        assert low <= exact.volume <= high
        assert low <= kernel.volume <= high
        points = np.array([[0.5, 0.5, 0.5], [9.0, 9.0, 9.0]])
        assert kernel.contains(points).dtype == bool
        assert kernel.contains(np.zeros((0, 3))).shape == (0,)
        assert kernel.classify(points).dtype == np.int8
        assert kernel.classify(points)[1] == -1
        assert kernel.to_points().shape[1:] == (3,)
        assert json.loads(json.dumps(kernel.to_dict(), allow_nan=False))["volume_bounds"] == list(kernel.volume_bounds)
        kernel.write(tmp_path / "kernel.ply")
        assert (tmp_path / "kernel.ply").read_bytes().startswith(b"ply\n")
        if not kernel.volume:
            assert exact.dimension < 3
        elif low:
            assert kernel.to_mesh().facts().volume == pytest.approx(exact.volume, rel=0.4)
        with pytest.raises(ValueError, match=r"`path` must end in .*; got .*k\.xyz"):
            kernel.write(tmp_path / "k.xyz")
        with pytest.raises(ValueError, match="`points` must have shape"):
            kernel.contains([1.0, 2.0])


def test_a_grid_of_undecided_voxels_is_not_called_empty():
    flat = voxkernel.voxel_kernel(shapes.s_tetromino(0.0), depth=4)
    assert flat.dimension in (1, 2)
    assert not flat.inside.active_voxel_count
    assert not flat.is_empty


# -- the polytope decides ---------------------------------------------------------------------------


def test_a_polytope_decides_the_last_bit():
    kernel = voxkernel.exact_kernel(shapes.tetrahedron())  # x, y, z >= 0 and x + y + z <= 1
    third = 1 / 3  # rounded down: three of them are below 1
    points = [[third] * 3, [third, third, third + 2.0**-53], [0, 0, 0], [0, 0, -5e-324], [0, 0, 1], [1, 1, 1]]
    truth = [min(p) >= 0 and sum(map(Fraction, p)) <= 1 for p in points]
    assert truth == [True, False, True, False, True, False]
    assert kernel.contains(points).tolist() == truth
    assert kernel.classify(points).tolist() == [1 if t else -1 for t in truth]
    assert kernel.contains([[1e308, -1e308, 1e308], [-1e200, 0, 0]]).tolist() == [False, False]


@pytest.mark.parametrize("offset", [0.0, 1e6, 1e11])
def test_a_polytope_agrees_with_rational_arithmetic(offset, rng):
    mesh = convex_body(offset)
    kernel = voxkernel.exact_kernel(mesh)
    weights = rng.dirichlet(np.ones(3), size=40)
    corners = mesh.vertices[mesh.faces[rng.integers(len(mesh.faces), size=40)]]
    on_facets = np.einsum("ij,ijk->ik", weights, corners)  # rounded: a little inside or outside
    points = np.concatenate([mesh.vertices, on_facets])
    planes = [oracle_plane(mesh, f) for f in mesh.faces]
    truth = [all(sum(n * x for n, x in zip(p[:3], map(Fraction, q), strict=True)) <= p[3] for p in planes)
             for q in points.tolist()]  # fmt: skip
    assert kernel.contains(points).tolist() == truth
    assert 0 < sum(truth[len(mesh.vertices) :]) < 40


def oracle_plane(mesh, face):
    a, b, c = ([Fraction(v) for v in mesh.vertices[k].tolist()] for k in face)
    u, v = ([q - p for p, q in zip(a, other, strict=True)] for other in (b, c))
    n = [u[i] * v[j] - u[j] * v[i] for i, j in ((1, 2), (2, 0), (0, 1))]
    return (*n, sum(p * q for p, q in zip(n, a, strict=True)))


def test_flat_and_empty_polytopes_decide():
    slit = voxkernel.exact_kernel(shapes.s_tetromino(0.0))
    assert 0 <= slit.dimension < 3
    inner = slit.vertices.mean(axis=0)
    assert slit.contains(np.stack([inner, inner + np.array([1e-9, 1e-9, 0])])).tolist() == [True, False]
    assert slit.contains(slit.vertices).all()
    empty = voxkernel.exact_kernel(shapes.two_boxes())
    assert empty.contains([[0, 0, 0], [0.5, 0.5, 0.5]]).tolist() == [False, False]


# -- the grid is certain ----------------------------------------------------------------------------


@pytest.mark.parametrize("frame", ["principal", "world"])
@pytest.mark.parametrize("offset", [0.0, 1e6, 1e8, 1e10, 1e11])
def test_grids_far_from_the_origin_keep_their_promise(offset, frame, rng):
    """Corners of the kernel, which are corners of the body, lie in inside or boundary voxels; answers are certain."""
    mesh = convex_body(offset)
    grid = voxkernel.voxel_kernel(mesh, depth=6, frame=frame)
    kernel = voxkernel.exact_kernel(mesh)
    active = np.array(list(exact_cells(grid.inside, mesh.vertices)), dtype=object)
    assert (active >= 0).all()
    assert (active <= 2**grid.depth).all()
    for cells in active:  # a closed voxel: of a point on a face, either
        around = np.array([[int(np.floor(v)) for v in cells], [int(np.ceil(v)) - 1 for v in cells]])
        assert (grid.inside.is_active(around) | grid.boundary.is_active(around)).any()
    assert (grid.classify(mesh.vertices) >= 0).all()
    # Random points, and points on voxel faces as nearly as doubles can be.
    ijk = grid.boundary.to_ijk(max_voxels=10**6)[:: max(1, grid.boundary.active_voxel_count // 300)]
    corners = (ijk + rng.integers(0, 2, size=ijk.shape)) @ grid.inside.linear.T + grid.origin
    points = np.concatenate([corners, grid.index_to_world(ijk), rng.normal(size=(50, 3)) + mesh.vertices.mean(axis=0)])
    answer, truth = grid.classify(points), kernel.contains(points)
    assert truth[answer == 1].all()
    assert not truth[answer == -1].any()
    assert {-1, 0, 1} == set(answer.tolist())


@pytest.mark.parametrize("offset", [0.0, 1e6, 1e11])
def test_classify_agrees_with_rational_voxels(offset, rng):
    mesh = convex_body(offset)
    grid = voxkernel.voxel_kernel(mesh, depth=5, frame="principal")
    ijk = grid.inside.to_ijk()[::40]
    points = (ijk + rng.integers(0, 2, size=ijk.shape)) @ grid.inside.linear.T + grid.origin
    for answer, cells in zip(grid.classify(points).tolist(), exact_cells(grid.inside, points), strict=True):
        voxel = np.array([[int(np.floor(v)) for v in cells]])
        true = 1 if grid.inside.is_active(voxel)[0] else 0 if grid.boundary.is_active(voxel)[0] else -1
        assert answer in (true, 0)


def test_a_point_on_a_face_belongs_to_both_voxels():
    """A cube of 4^3 voxels, the lower half inside: at the middle plane it is undecided, a hair below it is not."""
    masks = np.zeros((8, 8, 8), bool)
    masks[:4, :4, :2] = True
    whole = np.zeros((8, 8, 8), bool)
    whole[:4, :4, 2:4] = True
    inside, rest = SparseGrid.from_dense(masks), SparseGrid.from_dense(whole)
    grid = voxkernel.KernelGrid(inside, rest, 3, (32.0, 64.0), 3, None, "")
    points = [[1, 1, 2], [1, 1, np.nextafter(2, 0)], [1, 1, 1.99], [1, 1, 2.01], [1, 1, 4], [1, 1, 4.01], [1e308] * 3]
    assert grid.classify(points).tolist() == [0, 0, 1, 0, 0, -1, -1]
    assert grid.contains(points).tolist() == [False, False, True, False, False, False, False]
    assert grid.classify([[1, 1, 1], [2, 1, 0.5], [0, 1, 1], [-1e-300, 1, 1]]).tolist() == [1, 1, 0, 0]


def test_which_voxels_must_be_a_choice():
    grid = voxkernel.voxel_kernel(CUBE, depth=3)
    assert len(grid.to_points(which="boundary")) == grid.boundary.active_voxel_count
    with pytest.raises(ValueError, match="`which` must be one of 'inside', 'boundary'; got 'insid'"):
        grid.to_points(which="insid")


# -- files ------------------------------------------------------------------------------------------


def same(one, two):
    assert one.inside == two.inside
    assert one.boundary == two.boundary
    for name in ("depth", "volume_bounds", "dimension", "reason", "tolerance"):
        assert getattr(one, name) == getattr(two, name)


@pytest.mark.parametrize("suffix", [".npz", ".vdb", ".NPZ"])
@pytest.mark.parametrize(
    "options", [{"domain": "box"}, {"tolerance": 0.3, "domain": "ball"}, {"frame": "principal"}, {"rtol": 0.5}]
)
def test_kernel_grids_come_back_from_files(tmp_path, suffix, options):
    options = {"depth": 4, **options} if "rtol" not in options else options
    grid = voxkernel.voxel_kernel(shapes.l_prism(), **options)
    path = tmp_path / f"k{suffix}"
    grid.write(path, metadata={"source": "l.ply"})
    again = voxkernel.KernelGrid.read(path)
    same(again, grid)
    assert again.to_dict()["voxel_size"] == grid.voxel_size
    if suffix == ".vdb" or grid.domain is None:
        assert again.domain is None
    else:
        assert again.domain.kind == grid.domain.kind
        assert again.domain.volume == grid.domain.volume
        for name in ("normals", "offsets", "vertices"):
            assert np.array_equal(getattr(again.domain, name), getattr(grid.domain, name))
    assert not list(tmp_path.glob(".*"))


@pytest.mark.parametrize("write", [voxkernel.write_vdb, write_npz])
def test_writers_take_a_kernel_grid(tmp_path, write):
    grid = voxkernel.voxel_kernel(shapes.two_boxes(), depth=4)
    assert grid.is_empty
    path = tmp_path / ("k.vdb" if write is voxkernel.write_vdb else "k.npz")
    write(path, grid)
    same(voxkernel.KernelGrid.read(path), grid)
    write(path, voxkernel.voxel_kernel(CUBE, depth=4), metadata={"source": "cube"})
    assert voxkernel.KernelGrid.read(path).dimension == 3
    with pytest.raises(TypeError, match="`grids` must hold SparseGrid only; got int"):
        write(path, [3])


@pytest.mark.parametrize("suffix", [".npz", ".vdb"])
def test_library_and_command_line_read_each_other(tmp_path, capsys, suffix):
    mesh, path = tmp_path / "cube.ply", tmp_path / f"cube{suffix}"
    as_mesh(CUBE).write(mesh)
    assert main(["kernel", str(mesh), "-o", str(path), "--depth", "4", "--quiet"]) == 0
    capsys.readouterr()
    grid = voxkernel.voxel_kernel(CUBE, depth=4)
    same(voxkernel.KernelGrid.read(path), grid)
    if suffix == ".npz":
        assert [g.name for g in read_npz(path)] == ["inside", "boundary"]
        grid.write(path)
        assert main(["info", str(path), "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["volume_bounds"] == list(grid.volume_bounds)
        write_npz(path, SparseGrid.from_ijk([[0, 0, 0]], name="one"))
        assert main(["info", str(path)]) == 0
        assert "1 active voxels" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"volume_bounds": [2.0, 1.0]}, "in order; got 2.0, 1.0"),
        ({"volume_bounds": [2.0]}, "must hold a kernel grid"),
        ({"alpha": 7.0}, "in order"),
        ({"depth": 3.5}, "`depth` must be an integer"),
        ({"dimension": 4}, r"`dimension` must be in -1\.\.3; got 4"),
        ({"domain_polytope": {"normals": [[1, 0, 0]]}}, "its domain is damaged"),
        ({"domain_polytope": {"normals": [[1, 0, 0]], "offsets": [], "vertices": [], "volume": 1}}, "is damaged"),
    ],
)
def test_damaged_kernel_grids_are_refused(tmp_path, change, match):
    write_npz(tmp_path / "k.npz", voxkernel.voxel_kernel(CUBE, depth=3), metadata=change)
    with pytest.raises(GridReadError, match=match):
        voxkernel.KernelGrid.read(tmp_path / "k.npz")


def test_files_that_hold_no_kernel_grid_are_refused(tmp_path):
    one = SparseGrid.from_ijk([[0, 0, 0]], name="inside")
    for grids, match in (
        ([one], "no 'boundary'"),
        ({"inside": one, "boundary": SparseGrid.from_ijk([[9, 0, 0]])}, "share their leaves"),
        ({"inside": one, "boundary": SparseGrid.from_ijk([[0, 0, 0]], voxel_size=2)}, "same transform"),
        ({"inside": one, "boundary": one}, "no 'volume_bounds'"),
    ):
        voxkernel.write_vdb(tmp_path / "k.vdb", grids)
        with pytest.raises(GridReadError, match=match):
            voxkernel.KernelGrid.read(tmp_path / "k.vdb")
    with pytest.raises(GridReadError, match=r"k\.npz"):
        voxkernel.KernelGrid.read(tmp_path / "k.npz")
    with pytest.raises(ValueError, match=r"`path` must end in \.npz or \.vdb; got 'k\.ply'"):
        voxkernel.KernelGrid.read("k.ply")
    with pytest.raises(ValueError, match=r"`metadata` must be left out of a \.ply; got \['source'\]"):
        voxkernel.voxel_kernel(CUBE, depth=3).write(tmp_path / "k.ply", metadata={"source": "a"})
