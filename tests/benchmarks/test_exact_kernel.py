"""`exact_kernel` beside SciPy (HiGHS over all rows, Qhull) on meshes in memory."""

import pytest
from synthetic import CASES, scipy_kernel

import voxkernel
from voxkernel.halfspaces import HalfSpaces, find_feasibility


@pytest.mark.parametrize("n_facets", [1_000, 10_000, 100_000, 1_000_000])
@pytest.mark.parametrize("kernel", list(CASES))
def test_exact_kernel(side_by_side, kernel, n_facets):
    vertices, faces = CASES[kernel](n_facets)
    mesh = voxkernel.TriangleMesh.from_triangles(vertices, faces)
    voxkernel.exact_kernel(mesh)  # compiled loops
    answer = side_by_side(
        f"{len(faces)} facets, {kernel} kernel",
        {"voxkernel": lambda: voxkernel.exact_kernel(mesh), "scipy": lambda: scipy_kernel(vertices, faces)},
    )
    found = answer["voxkernel"][1]
    assert found.volume == pytest.approx(answer["scipy"][1], rel=1e-6)


def test_passes_on_empty_kernels(data_dir, capsys):
    for path in sorted((data_dir / "closed").glob("*.ply")):
        answer = find_feasibility(HalfSpaces.from_mesh(voxkernel.as_mesh(path)))
        with capsys.disabled():
            print(f"{path.name}: dimension {answer.dimension}, {answer.passes} passes over the planes")
        if answer.dimension < 0:
            assert answer.passes <= 3
