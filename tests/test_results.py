"""Every class with arrays, found by itself: compared by identity, read-only for good, one line as text."""

import copy
import dataclasses
import importlib
import inspect
import pickle
import pkgutil
import re
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from html.parser import HTMLParser
from multiprocessing import get_context
from types import MappingProxyType

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel._frozen import Frozen
from voxkernel._thumbnail import thumbnail
from voxkernel.halfspaces import planes_domain
from voxkernel.report.statistics import roc_curve

CUBE = shapes.cube()
# These say `==` by value, in their documentation.
BY_VALUE = ("SparseGrid",)


def classes():
    """Frozen dataclasses that hold arrays, themselves or in a part that does: name -> class."""
    found = {}
    for info in pkgutil.walk_packages(voxkernel.__path__, "voxkernel."):
        if info.name.startswith("voxkernel._core."):
            continue
        module = importlib.import_module(info.name)
        for name, thing in vars(module).items():
            if inspect.isclass(thing) and thing.__module__ == info.name and dataclasses.is_dataclass(thing):
                found[name] = thing
    words = {name: set(re.findall(r"\w+", " ".join(map(str, annotations(c))))) for name, c in found.items()}
    holders = {name for name in found if "NDArray" in words[name] or "ndarray" in words[name]}
    while more := {name for name in found if name not in holders and words[name] & holders}:
        holders |= more
    frozen = {name for name, c in found.items() if c.__dataclass_params__.frozen}
    return {name: found[name] for name in sorted(holders & frozen)}


def annotations(cls):
    return [field.type for field in dataclasses.fields(cls)]


HOLDERS = classes()
PUBLIC = [name for name in HOLDERS if name in voxkernel.__all__]


@cache
def star():
    return voxkernel.spherical_map(CUBE, center="coverage")


@cache
def cells():
    points, faces = shapes.cube()
    return voxkernel.PolyhedralMesh.from_cells([(points, faces.tolist())])


@cache
def pair():
    mesh = voxkernel.as_mesh(shapes.l_prism())
    return voxkernel.register_many([mesh, mesh], refine="none")[0]


@cache
def comb():
    return voxkernel.guards(shapes.l_prism())


@cache
def joint():
    mesh = voxkernel.as_mesh(shapes.l_prism())
    return voxkernel.register_together([mesh, mesh])


def polygon_mesh():
    return voxkernel.TriangleMesh.from_polygons(*shapes.prism_polygons([(0, 0), (2, 0), (2, 1), (0, 1)]))


def grid():
    return voxkernel.voxel_kernel(CUBE, depth=4)


def vdb_file(folder):
    voxkernel.write_vdb(folder / "a.vdb", grid().inside, metadata={"alpha": 0.5})
    return voxkernel.read_vdb(folder / "a.vdb")


# How each public one comes about; one that is missing here fails a test.
REAL = {
    "Candidate": lambda _: pair().registration.candidates[0],
    "CellKernels": lambda _: voxkernel.cell_kernels(cells()),
    "CertifiedParts": lambda _: comb().parts,
    "Certificate": lambda _: voxkernel.exact_kernel(CUBE).certificate,
    "CoverageCertificate": lambda _: voxkernel.spherical_map(shapes.open_hemisphere()).certificate,
    "DefectProfile": lambda _: voxkernel.defect_profile(CUBE, tolerances=[0.0, 0.5], depth=3),
    "Domain": lambda _: planes_domain(np.r_[np.eye(3), -np.eye(3)], np.ones(6)),
    "Guards": lambda _: comb(),
    "HalfSpaces": lambda _: voxkernel.HalfSpaces.from_mesh(voxkernel.as_mesh(CUBE)),
    "Harmonics": lambda _: star().harmonics(2),
    "JointRegistration": lambda _: joint(),
    "JudgedPair": lambda _: joint().pairs[0],
    "KernelGrid": lambda _: grid(),
    "KernelMoments": lambda _: voxkernel.kernel_moments(voxkernel.exact_kernel(CUBE)),
    "KernelPoints": lambda _: voxkernel.kernel_points(voxkernel.exact_kernel(CUBE)),
    "KernelPolytope": lambda _: voxkernel.exact_kernel(CUBE, domain="box"),
    "LabelImage": lambda _: dataclasses.replace(label_image(), affine=np.eye(4), unit="um"),
    "LabelObjects": lambda _: voxkernel.find_objects(label_image()),
    "LabelStars": lambda _: voxkernel.label_stars(label_image()),
    "MeshFacts": lambda _: voxkernel.as_mesh(CUBE).facts(),
    "PairRegistration": lambda _: pair(),
    "PolyhedralMesh": lambda _: cells(),
    "RadialGrid": lambda _: star().sample(n=8),
    "Registration": lambda _: pair().registration,
    "RepairResult": lambda _: voxkernel.repair(CUBE, merge_duplicates=True),
    "SparseGrid": lambda _: dataclasses.replace(grid().inside, metadata={"alpha": 0.5}),
    "SphereGrid": lambda _: star().sample(n=8).grid,
    "SphericalMap": lambda _: star(),
    "StarCover": lambda _: voxkernel.star_cover(comb()),
    "StarPiece": lambda _: voxkernel.star_cover(comb()).pieces[0],
    "StarKernels": lambda _: voxkernel.star_polyhedra_kernels(
        np.zeros((1, 3)), np.ones((1, 6)), np.vstack([np.eye(3), -np.eye(3)])
    ),
    "StarCenter": lambda _: voxkernel.best_center(CUBE),
    "Starshapeness": lambda _: voxkernel.starshapeness(CUBE),
    "TriangleMesh": lambda _: polygon_mesh(),
    "VdbFile": vdb_file,
}


def label_image():
    return voxkernel.LabelImage.from_array(np.array([[1, 1, 0], [0, 2, 2]]), spacing=(1, 2))


INSIDE = {
    "RocCurve": lambda _: roc_curve([0.9, 0.1], [True, False]),
    "ReportRows": lambda _: HOLDERS["ReportRows"](1, {"file": ["a"]}, {"cell": np.zeros(1)}, {}, ["failed"]),
}


def stand_in(cls):
    """An instance of a class that only the library makes: writeable arrays, and little else."""
    given = {}
    for field in dataclasses.fields(cls):
        is_array = str(field.type).startswith("NDArray")
        if field.init:
            held = (np.zeros(2), 1) if "tuple" in str(field.type) else None
            given[field.name] = np.arange(6.0).reshape(2, 3) if is_array else held
    return cls(**given)


def made(name, folder):
    maker = REAL.get(name) or INSIDE.get(name)
    return maker(folder) if maker else stand_in(HOLDERS[name])


def arrays_in(value):
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, tuple | list):
        for item in value:
            yield from arrays_in(item)
    elif isinstance(value, dict | MappingProxyType):
        yield from arrays_in(list(value.values()))
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            yield from arrays_in(getattr(value, field.name))


def mappings_in(thing):
    for field in dataclasses.fields(thing):
        value = getattr(thing, field.name)
        yield from (v for v in (value if type(value) is tuple else (value,)) if isinstance(v, dict | MappingProxyType))


def changed(thing):
    """What a worker process makes of a result, and whether it could change it."""
    return thing, [array.flags.writeable for array in arrays_in(thing)]


def test_every_public_class_has_an_example():
    assert set(PUBLIC) == set(REAL)


def test_the_classes_are_found():
    assert {"TriangleMesh", "Certificate", "VdbFile", "PairRegistration", "RootCube", "Guess"} <= set(HOLDERS)
    assert "Witness" not in HOLDERS


@pytest.mark.parametrize("name", HOLDERS)
def test_results_behave(name, tmp_path):
    cls = HOLDERS[name]
    assert issubclass(cls, Frozen)
    one = made(name, tmp_path)
    twin = copy.deepcopy(one)
    copies = {"itself": one, "deepcopy": twin, "copy": copy.copy(one), "pickle": pickle.loads(pickle.dumps(one))}
    for protocol in (2, 5):
        copies[f"protocol {protocol}"] = pickle.loads(pickle.dumps(one, protocol=protocol))
    if all(field.init for field in dataclasses.fields(cls)):
        copies["replace"] = dataclasses.replace(one)

    if name in BY_VALUE:
        assert one == twin
        assert hash(one) == hash(twin)
    else:
        assert one == copies["itself"]
        assert one != twin
        assert len({one, twin, one}) == 2

    for how, other in copies.items():
        assert type(other) is cls, how
        assert not any(array.flags.writeable for array in arrays_in(other)), how
        for array, first in zip(arrays_in(other), arrays_in(one), strict=True):
            assert array.dtype == first.dtype
            assert np.array_equal(array, first, equal_nan=array.dtype.kind == "f"), how
        for mapping in mappings_in(other):
            assert isinstance(mapping, MappingProxyType), how
        assert repr(other) == repr(one), how
    assert re.fullmatch(rf"{name}\(.{{0,400}}\)", repr(one)), repr(one)
    if name in REAL:
        assert len(repr(one)) <= 240, repr(one)
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(one, dataclasses.fields(cls)[0].name, None)


def test_read_only_from_a_worker_process():
    things = [voxkernel.exact_kernel(CUBE), grid(), polygon_mesh(), voxkernel.best_center(CUBE)]
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        for thing, (back, there) in zip(things, pool.map(changed, things), strict=True):
            assert there
            assert not any(there)
            assert type(back) is type(thing)
            assert not any(array.flags.writeable for array in arrays_in(back))
            for array in arrays_in(back):
                with pytest.raises(ValueError, match="read-only"):
                    array[...] = 0


def test_an_array_of_the_caller_stays_writeable():
    mesh = polygon_mesh()
    vertices = 2.0 * mesh.vertices
    moved = dataclasses.replace(mesh, vertices=vertices)
    vertices[0] = 0.0
    assert not moved.vertices.flags.writeable


@pytest.mark.parametrize("make", [polygon_mesh, lambda: voxkernel.as_mesh(CUBE)])
def test_caches_are_not_carried_over(make):
    mesh = make()
    volume, areas = mesh.facts().volume, mesh.plane_areas
    larger = dataclasses.replace(mesh, vertices=10 * mesh.vertices)
    assert larger.facts().volume == pytest.approx(1000 * volume, rel=1e-14)
    assert np.allclose(larger.plane_areas, 100 * areas, rtol=1e-14)


def test_areas_of_mixed_polygons_are_found_again():
    """A square of side 2, a triangle of area 2, and a polygon that is not planar, in two triangles."""
    corners = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [4, 0, 0], [0, 4, 1], [-2, 3, -1]]
    mesh = voxkernel.TriangleMesh.from_polygons(corners, [[0, 1, 2, 3], [1, 4, 2], [3, 2, 5, 6]])
    again = dataclasses.replace(mesh)
    assert mesh.nonplanar_facets.tolist() == [2]
    assert np.allclose(again.plane_areas, mesh.plane_areas, rtol=1e-14)
    assert again.plane_areas[:2].tolist() == [4.0, 2.0]
    assert np.allclose(dataclasses.replace(mesh.restricted([0, 2])).plane_areas, mesh.plane_areas[[0, 2, 3]])


def test_searches_start_anew_in_a_renamed_grid():
    first = grid().inside
    assert first.is_active(first.to_ijk()).all()
    second = dataclasses.replace(first, tile_ijk=[[8, 8, 8]], tile_log2=[3], leaf_ijk=[], leaf_mask=[])
    assert second.is_active([[8, 8, 8], first.to_ijk()[0]]).tolist() == [True, (first.to_ijk()[0] >= 8).all()]
    assert second.active_voxel_count == 512


def test_metadata_cannot_be_changed(tmp_path):
    given = {"alpha": 0.5}
    labelled = dataclasses.replace(voxkernel.SparseGrid.from_ijk([[0, 0, 0]]), metadata=given)
    given["alpha"] = 7.0
    voxkernel.write_vdb(tmp_path / "a.vdb", labelled, metadata={"source": "cube"})
    file = voxkernel.read_vdb(tmp_path / "a.vdb")
    assert labelled.metadata == {"alpha": 0.5}
    assert pickle.loads(pickle.dumps(file)).metadata == {"source": "cube"}
    for mapping in (labelled.metadata, labelled.to_mask().metadata, file.metadata, file[0].metadata, file.entries[0]):
        with pytest.raises(TypeError, match="does not support item assignment"):
            mapping["alpha"] = 1.0


class _Cells(HTMLParser):
    """Text of the cells of a table, row by row; whatever is no part of a table is an error."""

    def __init__(self):
        super().__init__()
        self.rows, self.tags = [], set()

    def handle_starttag(self, tag, attributes):
        self.tags.add(tag)
        if tag == "tr":
            self.rows.append([])

    def handle_data(self, data):
        if self.rows:
            self.rows[-1].append(data)


# Public classes without arrays; the others are in REAL.
WITHOUT_ARRAYS = {
    "EvaluateSettings": lambda _: voxkernel.EvaluateSettings(),
    "EvaluationResult": lambda _: voxkernel.EvaluationResult("run", 3, 2, 1, 0, ()),
    "GuardBound": lambda _: voxkernel.guards(CUBE, bound=True).bound,
    "GuardsProgress": lambda _: voxkernel.GuardsProgress("search", 2, 0.5, 1.0),
    "PackedSurfaces": lambda _: voxkernel.PackedSurfaces(*map(np.array, (*CUBE, [0, len(CUBE[1])]))),
    "ReconstructionError": lambda _: voxkernel.ReconstructionError(0.5, 0.25),
    "RepairChange": lambda _: voxkernel.repair(CUBE, merge_duplicates=True).changes[0],
    "StreamProgress": lambda _: voxkernel.StreamProgress("reading", 1, 2, 0.5),
    "StreamedSurface": lambda _: voxkernel.stream_mesh(CUBE),
    "VisibleFraction": lambda _: voxkernel.visible_fraction(CUBE, [0.0, 0.0, 0.0]),
}
PICTURES = {"DefectProfile", "KernelGrid", "KernelPolytope", "TriangleMesh"}


def fields_of(thing):
    if dataclasses.is_dataclass(thing):
        return [field.name for field in dataclasses.fields(thing) if field.repr and field.name[0] != "_"]
    return list(thing._fields)


def test_every_public_class_shows_itself_in_a_notebook():
    public = {name for name in voxkernel.__all__ if inspect.isclass(getattr(voxkernel, name))}
    errors = {name for name in public if issubclass(getattr(voxkernel, name), Exception)}
    assert public - errors - {"Kernel"} == {*PUBLIC, *WITHOUT_ARRAYS}  # `Kernel` is a protocol


@pytest.mark.parametrize("name", sorted({*PUBLIC, *WITHOUT_ARRAYS}))
def test_notebooks_show_a_small_table(name, tmp_path):
    thing = (REAL | WITHOUT_ARRAYS)[name](tmp_path)
    text = thing._repr_html_()
    table = _Cells()
    table.feed(text)
    assert table.tags - {"img", "svg", "polyline"} <= {"table", "caption", "b", "tbody", "tr", "th", "td"}
    assert bool(table.tags & {"img", "svg"}) == (name in PICTURES)
    assert len(re.sub('src="[^"]*"', "", text)) < 6000
    assert len(text) < 30_000
    shown = [word.replace("_", " ") for word in fields_of(thing)]
    names = [row[0] for row in table.rows]
    of_fields = [word for word in names if word in shown]
    assert names[: len(of_fields)] == of_fields == [word for word in shown if word in names]  # in order
    assert len(names) >= 2
    assert all(row[1] for row in table.rows)  # what holds nothing is left out
    assert f"<b>{name}</b>" in text


def test_a_notebook_shows_what_proves_a_kernel():
    for surface, kind in ((CUBE, "solid"), (shapes.torus(n_major=8, n_minor=6), "empty")):
        table = _Cells()
        table.feed(voxkernel.exact_kernel(surface)._repr_html_())
        assert dict(table.rows)["certificate"].startswith(f"Certificate(kind='{kind}'")


def pixels_of(text):
    from base64 import b64decode
    from io import BytesIO

    image = pytest.importorskip("PIL.Image", reason="Pillow is not installed")
    data = re.search('src="data:image/png;base64,([^"]*)"', text)[1]
    return np.asarray(image.open(BytesIO(b64decode(data))).convert("RGBA")).astype(int)


def test_the_picture_of_a_cube_has_three_sides_and_a_clear_ground():
    image = pixels_of(voxkernel.as_mesh(CUBE)._repr_html_())
    assert image.shape == (150, 200, 4)
    drawn = image[image[..., 3] > 0]
    shades, counts = np.unique(drawn, axis=0, return_counts=True)
    assert len(shades[counts > 0.1 * len(drawn)]) == 3
    assert 0.2 < len(drawn) / (150 * 200) < 0.6
    assert (image[[0, 0, -1, -1], [0, -1, 0, -1], 3] == 0).all()


def test_pictures_have_the_colours_of_their_kernels():
    exact, relaxed = grid(), voxkernel.voxel_kernel(CUBE, depth=4, tolerance=0.3)
    for kernel, order in ((exact, [0, 1, 2]), (voxkernel.exact_kernel(CUBE), [0, 1, 2]), (relaxed, [0, 2, 1])):
        image = pixels_of(kernel._repr_html_())
        middle = image[image[..., 3] > 0][:, :3].mean(axis=0)
        assert np.argsort(-middle).tolist() == order  # orange: red, green, blue; purple: red, blue, green


def test_there_is_no_picture_of_what_is_huge_or_nothing():
    assert "<img" not in voxkernel.exact_kernel(shapes.torus(n_major=8, n_minor=6))._repr_html_()
    n = 2_000_001
    many = thumbnail(np.eye(3), np.broadcast_to(np.arange(3), (n, 3)), (1, 2, 3))
    assert many == thumbnail(np.zeros((3, 3)), np.array([[0, 1, 2]]), (1, 2, 3)) == ""


def test_a_notebook_shows_the_answer_and_its_proof():
    table = _Cells()
    table.feed(voxkernel.starshapeness(shapes.torus(n_major=8, n_minor=6))._repr_html_())
    rows = dict(table.rows)
    assert (rows["verdict"], rows["ratio"], rows["is closed"]) == ("not star-shaped", "0", "yes")
    assert rows["reason"].startswith("no point is on the inner side of facets ")
    assert rows["certificate"].startswith("Certificate(kind='empty', facet_ids=(")
    assert len(rows["star center"].split(", ")) == 3
    assert "center" not in rows  # there is none


def test_what_a_notebook_shows_is_no_markup():
    mesh = voxkernel.TriangleMesh.from_triangles(*CUBE, source="<script>alert(1)</script>")
    assert "<script>" not in mesh._repr_html_()
    assert "&lt;script&gt;" in mesh._repr_html_()


def test_what_a_notebook_shows_of_a_large_mesh_is_small():
    assert len(voxkernel.as_mesh(shapes.icosphere(5))._repr_html_()) < 30_000
