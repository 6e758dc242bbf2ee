"""The same word means the same in every function: the glossary of the docs against the signatures of all callables."""

import importlib
import inspect
import re
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel.exact import kernel_of_halfspaces
from voxkernel.halfspaces import HalfSpaces, find_feasibility
from voxkernel.polyhedral import PolyhedralMesh
from voxkernel.registration import prepare_surface
from voxkernel.view import open_viewer, slider_page

PAGE = Path(__file__).resolve().parents[1] / "docs" / "glossary.md"
FACES = (
    "mesh", "halfspaces", "exact", "relaxed", "grid", "vdb", "voxels", "guarding", "measures", "spherical",
    "registration", "polyhedral", "labels", "large", "pictures", "view", "evaluation", "report",
)  # fmt: skip
REQUIRED = "required"


def public_callables():
    """Name -> parameters of each function, of each method of a class, and of the one class that holds options."""
    found = {"EvaluateSettings": list(inspect.signature(voxkernel.EvaluateSettings).parameters.values())}
    for home in (voxkernel, *(importlib.import_module(f"voxkernel.{face}") for face in FACES)):
        for name in home.__all__:
            thing = getattr(home, name)
            if inspect.isfunction(thing):
                found[name] = list(inspect.signature(thing).parameters.values())
            elif inspect.isclass(thing):
                found |= {f"{name}.{method}": parameters for method, parameters in methods(thing)}
    return found


def methods(cls):
    for name, value in vars(cls).items():
        if name.startswith("_"):
            continue
        if isinstance(value, classmethod | staticmethod):
            yield name, list(inspect.signature(getattr(cls, name)).parameters.values())
        elif inspect.isfunction(value):
            yield name, list(inspect.signature(value).parameters.values())[1:]


def words_taken():
    """Word -> default -> callables; what has no default is required."""
    found = defaultdict(lambda: defaultdict(set))
    for name, parameters in public_callables().items():
        for parameter in parameters:
            default = REQUIRED if parameter.default is parameter.empty else repr(parameter.default)
            found[parameter.name][default].add(name)
    several = {word: defaults for word, defaults in found.items() if sum(map(len, defaults.values())) > 1}
    return {word: {default: sorted(names) for default, names in defaults.items()} for word, defaults in several.items()}


TAKEN = words_taken()
OPTIONS = {w: d for w, d in TAKEN.items() if sum(len(names) for default, names in d.items() if default != REQUIRED) > 1}


def tables():
    """The rows of the two tables of the page, word -> cells."""
    parts = PAGE.read_text(encoding="utf-8").split("\n## ")
    rows = {}
    for part in parts[1:]:
        cells = [re.split(r"(?<!\\) \| ", line[2:-2]) for line in part.splitlines() if line.startswith("| `")]
        rows[part.splitlines()[0]] = {row[0].strip("`"): row[1:] for row in cells}
    return rows["Options"], rows["What functions work on"]


SHOWN, SUBJECTS = tables()


def cell_of(defaults):
    order = sorted(defaults.items(), key=lambda pair: (pair[0] == REQUIRED, -len(pair[1]), pair[0]))
    return "; ".join(
        (REQUIRED if default == REQUIRED else f"`{default}`") + ": " + ", ".join(f"`{n}`" for n in names)
        for default, names in order
    )


def test_the_glossary_lists_the_words_that_several_functions_take():
    assert list(SHOWN) == sorted(OPTIONS)
    assert list(SUBJECTS) == sorted(set(TAKEN) - set(OPTIONS))


@pytest.mark.parametrize("word", sorted(OPTIONS))
def test_defaults_and_takers_are_those_of_the_signatures(word):
    meaning, limits, defaults, why = SHOWN[word]
    assert meaning
    assert limits
    assert defaults == cell_of(OPTIONS[word])
    # The same word has one default, or the row says why not.
    assert bool(why.strip("- ")) == (len(OPTIONS[word]) > 1), why


@pytest.mark.parametrize("word", sorted(set(TAKEN) - set(OPTIONS)))
def test_subjects_have_a_meaning(word):
    (meaning,) = SUBJECTS[word]
    assert meaning.endswith(".")


# ---------------------------------------------------------------- limits: what a row promises is refused alike

CUBE = shapes.cube()
CELLS = PolyhedralMesh.from_cells(
    [([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])]
)
IMAGE = voxkernel.LabelImage.from_array(np.ones((2, 2), np.uint8), spacing=(1, 1))
SPHERE = voxkernel.spherical_map(CUBE)
SAMPLES, HARMONICS = SPHERE.sample(n=8), SPHERE.harmonics(2)
CALLS = {
    "HalfSpaces.coplanar_groups": lambda **o: HalfSpaces.from_planes([[1, 0, 0]], [1]).coplanar_groups(**o),
    "find_feasibility": lambda **o: find_feasibility(HalfSpaces.from_planes([[1, 0, 0]], [1]), **o),
    "kernel_of_halfspaces": lambda **o: kernel_of_halfspaces(HalfSpaces.from_planes([[1, 0, 0]], [1]), None, **o),
    "HalfSpaces.from_mesh": lambda **o: voxkernel.HalfSpaces.from_mesh(voxkernel.as_mesh(CUBE), **o),
    "EvaluateSettings": voxkernel.EvaluateSettings,
    "Harmonics.on_grid": HARMONICS.on_grid,
    "HalfSpaces.from_planes": lambda **o: HalfSpaces.from_planes([[1, 0, 0]], [1], **o),
    "PolyhedralMesh.cell": lambda **o: CELLS.cell(0, **o),
    "RadialGrid.harmonics": SAMPLES.harmonics,
    "SparseGrid.from_dense": lambda **o: voxkernel.SparseGrid.from_dense(np.ones((2, 2, 2)), **o),
    "SparseGrid.from_ijk": lambda **o: voxkernel.SparseGrid.from_ijk([[0, 0, 0]], **o),
    "SparseGrid.from_points": lambda **o: voxkernel.SparseGrid.from_points([[0.0, 0, 0]], **o),
    "SparseGrid.from_tiles_and_leaves": lambda **o: voxkernel.SparseGrid.from_tiles_and_leaves(
        np.zeros((0, 3), np.int32), np.zeros(0, np.int8), np.zeros((0, 3), np.int32), np.zeros((0, 8), np.uint64), **o
    ),
    "SphericalMap.harmonics": SPHERE.harmonics,
    "SphericalMap.reconstruct": SPHERE.reconstruct,
    "SphericalMap.sample": SPHERE.sample,
    "TriangleMesh.from_polygons": lambda **o: voxkernel.TriangleMesh.from_polygons(*CUBE, **o),
    "as_mesh": lambda **o: voxkernel.as_mesh(CUBE, **o),
    "best_center": lambda **o: voxkernel.best_center(CUBE, **o),
    "cell_kernels": lambda **o: voxkernel.cell_kernels(CELLS, **o),
    "defect_profile": lambda **o: voxkernel.defect_profile(CUBE, **o),
    "exact_kernel": lambda **o: voxkernel.exact_kernel(CUBE, **o),
    "exact_kernels": lambda **o: voxkernel.exact_kernels([CUBE], **o),
    "guards": lambda **o: voxkernel.guards(CUBE, **o),
    "find_objects": lambda **o: voxkernel.find_objects(IMAGE, **o),
    "label_stars": lambda **o: voxkernel.label_stars(IMAGE, **o),
    "star_polyhedra_kernels": lambda **o: voxkernel.star_polyhedra_kernels(
        np.zeros((1, 3)), np.ones((1, 6)), np.vstack([np.eye(3), -np.eye(3)]), **o
    ),
    "open_viewer": lambda **o: open_viewer(CUBE, browser=False, **o),
    "prepare_surface": lambda **o: prepare_surface(CUBE, **o),
    "register": lambda **o: voxkernel.register(CUBE, CUBE, **o),
    "register_many": lambda **o: voxkernel.register_many([CUBE, CUBE], **o),
    "register_together": lambda **o: voxkernel.register_together([CUBE, CUBE], **o),
    "slider_page": lambda **o: slider_page("never.html", CUBE, **o),
    "spherical_map": lambda **o: voxkernel.spherical_map(CUBE, **o),
    "starshapeness": lambda **o: voxkernel.starshapeness(CUBE, **o),
    "violation": lambda **o: voxkernel.violation(CUBE, [[0, 0, 0]], **o),
    "violation_grid": lambda **o: voxkernel.violation_grid(CUBE, **o),
    "voxel_kernel": lambda **o: voxkernel.voxel_kernel(CUBE, **o),
    "voxel_kernels": lambda **o: voxkernel.voxel_kernels(
        CUBE, **(o if o.keys() & {"tolerances", "margins"} else {"tolerances": [0.1], **o})
    ),
}


def values_outside(limits, name):
    """Values that the text of a row forbids to one function."""
    words = limits.split("; ")
    if match := re.match(r"(integer|share|shares) (\S+) to (\S+)$", words[0]):
        kind, low, high = match.groups()
        for other in words[1:]:
            exception = re.match(r"up to (\S+) of `(\w+)`$", other)
            if exception and exception[2] == name:
                high = exception[1]
        if kind == "integer":
            return [int(low) - 1, int(high) + 1]
        return [v if kind == "share" else [v] for v in (float(low) - 0.5, float(high) + 0.5)]
    if words[0].startswith("each >= 0"):
        return [[-1.0]]
    if words[0].startswith(">= 0"):
        return [-1.0]
    if words[0].startswith("> 0"):
        return [0.0]
    if words[0].startswith("one of "):
        return ["neither"]
    return []


CASES = [
    (word, name, value)
    for word in sorted(OPTIONS)
    for default, names in OPTIONS[word].items()
    for name in names
    if default != REQUIRED
    for value in (values_outside(SHOWN[word][1], name) if word in SHOWN else [])
]


def test_limits_are_held_against_the_page():
    checked = {word for word, _, _ in CASES}
    assert checked >= {"depth", "threads", "tolerance", "tolerances", "margin", "margins", "gap", "frame", "domain"}


@pytest.mark.parametrize(("word", "name", "value"), CASES, ids=[f"{w}={v}-{n}" for w, n, v in CASES])
def test_what_a_row_forbids_is_refused_by_every_taker(word, name, value):
    with pytest.raises(ValueError, match=f"`{word}` must") as caught:
        CALLS[name](**{word: value})
    assert "\n" not in str(caught.value)
