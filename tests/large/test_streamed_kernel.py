"""The kernel of a streamed surface is that of memory to the last bit, whatever the chunks."""

import numpy as np
import pytest
import shapes
from streams import assert_same, proof

import voxkernel

SHAPES = {
    "tetrahedron": shapes.tetrahedron(),  # all facets bound it
    "star prism": shapes.star_prism(),
    "flat": shapes.s_tetromino(),
    "segment": shapes.saw_prism(),
    "point": shapes.notched_cube(),
    "empty": shapes.two_boxes(),
    "empty, from the sample": shapes.torus(),
    "convex": shapes.icosphere(1),
    "spiky": shapes.spiky(2),
    "open": shapes.open_box(),
    "open, flat": shapes.cube_with_flipped_face(),
    "open, one side": shapes.moebius_band(),
}


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("chunk", [1, 7, 1000])
def test_chunks_do_not_matter(name, chunk):
    kernel = voxkernel.exact_kernel(voxkernel.stream_mesh(SHAPES[name], chunk_facets=chunk))
    assert_same(kernel, voxkernel.exact_kernel(SHAPES[name]))


def test_planes_that_cannot_matter_are_dropped():
    mesh = shapes.spiky(4)
    kernel = voxkernel.exact_kernel(voxkernel.stream_mesh(mesh, chunk_facets=777))
    assert len(kernel.certificate.halfspaces) < len(mesh[1]) // 4
    assert_same(kernel, voxkernel.exact_kernel(mesh))


@pytest.mark.parametrize("name", ["star prism", "flat", "open, flat"])
def test_far_from_the_origin_it_is_the_same(name):
    vertices, faces = SHAPES[name]
    mesh = 0.3 * np.asarray(vertices) + [1e7, -3e8, 5.0], faces
    kernel = voxkernel.exact_kernel(voxkernel.stream_mesh(mesh, chunk_facets=7))
    assert_same(kernel, voxkernel.exact_kernel(mesh))


def test_strays_and_facets_without_area_change_nothing():
    vertices, faces = shapes.star_prism()
    stray = np.concatenate([[[1e9, 0, 0]], vertices, [[0.0, 1e-9, 0.0]]])
    faces = np.insert(faces + 1, [0, 5, 28], [[1, 1, 2], [3, 4, 4], [1, 1, 1]], axis=0)
    for chunk in (1, 7, 1000):
        surface = voxkernel.stream_mesh((stray, faces), chunk_facets=chunk)
        assert_same(voxkernel.exact_kernel(surface), voxkernel.exact_kernel((stray, faces)))
        assert surface.n_degenerate == 3


def test_a_facet_on_a_line_has_no_area():
    vertices, faces = shapes.cube()
    vertices = np.concatenate([vertices, [[0.1, 0.1, 0.1], [0.2, 0.2, 0.2], [0.3, 0.3, 0.3]]])
    faces = np.concatenate([[[8, 9, 10]], faces])
    whole = voxkernel.as_mesh((vertices, faces))
    surface = voxkernel.stream_mesh((vertices, faces), chunk_facets=5)
    assert surface.n_degenerate == voxkernel.HalfSpaces.from_mesh(whole).n_degenerate
    assert_same(voxkernel.exact_kernel(surface), voxkernel.exact_kernel(whole))


@pytest.mark.parametrize("domain", ["box", (np.concatenate([np.eye(3), -np.eye(3)]), np.full(6, 0.3))])
@pytest.mark.parametrize("name", ["star prism", "segment", "open", "empty"])
def test_domains_that_are_given(name, domain):
    mesh = SHAPES[name]
    kernel = voxkernel.exact_kernel(voxkernel.stream_mesh(mesh, chunk_facets=7), domain=domain)
    assert_same(kernel, voxkernel.exact_kernel(mesh, domain=domain))


def test_the_hull_is_that_of_memory_up_to_rounding():
    mesh = SHAPES["star prism"]
    kernel = voxkernel.exact_kernel(voxkernel.stream_mesh(mesh, chunk_facets=7), domain="hull")
    assert kernel.volume == pytest.approx(voxkernel.exact_kernel(mesh, domain="hull").volume)


def test_sums_of_an_open_surface_do_not_depend_on_chunks():
    x, y = np.meshgrid(np.linspace(-1, 1, 200), np.linspace(-1, 1, 200))
    vertices = np.stack([x, y, 0.1 * np.sin(5 * x) * y**2], axis=2).reshape(-1, 3)
    a = np.arange(199)[:, None] * 200 + np.arange(199)
    faces = np.stack([np.stack([a, a + 1, a + 201], -1), np.stack([a, a + 201, a + 200], -1)]).reshape(-1, 3)
    assert len(faces) > 2**16  # more than one block of sums
    whole = voxkernel.halfspaces.ball_domain(voxkernel.as_mesh((vertices, faces)))
    for chunk in (10_000, 1 << 18):
        ball = voxkernel.stream_mesh((vertices, faces), chunk_facets=chunk)._reader.ball()
        np.testing.assert_array_equal(ball.normals, whole.normals)
        np.testing.assert_array_equal(ball.offsets, whole.offsets)


def test_an_empty_kernel_stops_at_its_witness():
    stages = []
    surface = voxkernel.stream_mesh(shapes.torus(), progress=lambda state: stages.append(state.stage))
    kernel = voxkernel.exact_kernel(surface)
    assert kernel.is_empty
    assert kernel.certificate.verify()
    assert set(stages) == {"frame"}


def test_of_an_open_empty_surface_no_domain_is_made():
    vertices, faces = shapes.torus()
    mesh = vertices, faces[1:]
    kernel = voxkernel.exact_kernel(voxkernel.stream_mesh(mesh))
    assert kernel.domain is None
    assert proof(kernel.certificate) == proof(voxkernel.exact_kernel(mesh).unclipped_certificate)


def test_where_most_facets_stay_progress_says_so():
    notes = []
    mesh = shapes.icosphere(2)
    surface = voxkernel.stream_mesh(mesh, progress=lambda state: notes.append(state.note))
    assert_same(voxkernel.exact_kernel(surface), voxkernel.exact_kernel(mesh))
    assert any("most of 320 facets may bound the kernel: it is found in memory, about 0.2 MB" in note for note in notes)


def test_a_surface_that_neither_can_be_culled_nor_fits_says_so(monkeypatch):
    def fails(reader):
        raise MemoryError

    monkeypatch.setattr("voxkernel.large.surface_reader.SurfaceReader.to_mesh", fails)
    with pytest.raises(MemoryError, match="`surface` must fit in memory: most of 320 facets may bound the kernel"):
        voxkernel.exact_kernel(voxkernel.stream_mesh(shapes.icosphere(2)))


def test_facets_of_a_stream_are_refused():
    with pytest.raises(ValueError, match="`facets` must be None for a streamed surface; got facets"):
        voxkernel.exact_kernel(voxkernel.stream_mesh(shapes.cube()), facets=[0])
