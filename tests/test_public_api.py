"""What users may rely on: the list of names and what their docstrings say."""

import ast
import inspect
import os
import re
import subprocess
import sys
import typing
from importlib import import_module
from itertools import pairwise
from pathlib import Path

import pytest

import voxkernel

# Changing this list changes the public interface: say so in CHANGELOG.md.
NAMES = [
    "Candidate",
    "CellKernels",
    "Certificate",
    "CertifiedParts",
    "CoverageCertificate",
    "DefectProfile",
    "Domain",
    "EvaluateSettings",
    "EvaluationResult",
    "GridReadError",
    "GuardBound",
    "Guards",
    "GuardsProgress",
    "HalfSpaces",
    "Harmonics",
    "JointRegistration",
    "JudgedPair",
    "Kernel",
    "KernelGrid",
    "KernelMoments",
    "KernelPoints",
    "KernelPolytope",
    "LabelImage",
    "LabelObjects",
    "LabelStars",
    "MeshError",
    "MeshFacts",
    "MeshReadError",
    "MissingExtraError",
    "PackedSurfaces",
    "PairRegistration",
    "PolyhedralMesh",
    "RadialGrid",
    "ReconstructionError",
    "Registration",
    "RepairChange",
    "RepairResult",
    "SolverError",
    "SparseGrid",
    "SphereGrid",
    "SphericalMap",
    "StarCenter",
    "StarCover",
    "StarKernels",
    "StarPiece",
    "Starshapeness",
    "StreamProgress",
    "StreamedSurface",
    "TriangleMesh",
    "VdbFile",
    "VisibleFraction",
    "VoxKernelError",
    "as_mesh",
    "best_center",
    "cell_kernels",
    "defect_profile",
    "evaluate",
    "exact_kernel",
    "exact_kernels",
    "find_objects",
    "guards",
    "kernel_moments",
    "kernel_points",
    "label_stars",
    "paint_labels",
    "read_labels",
    "read_polyhedral",
    "read_vdb",
    "register",
    "register_many",
    "register_together",
    "repair",
    "spherical_map",
    "star_cover",
    "star_polyhedra_kernels",
    "starshapeness",
    "stream_mesh",
    "violation",
    "violation_grid",
    "visible_fraction",
    "voxel_kernel",
    "voxel_kernels",
    "write_labels",
    "write_report",
    "write_vdb",
]
ERRORS = [name for name in NAMES if name.endswith("Error") and name != "ReconstructionError"]
CALLABLES = [name for name in NAMES if name not in ERRORS]
# Classes that users make themselves; the others come back from functions.
MADE_BY_USERS = ("EvaluateSettings", "SparseGrid", "TriangleMesh")


def sections(name):
    lines = inspect.getdoc(getattr(voxkernel, name)).splitlines()
    return {a.strip() for a, b in pairwise(lines) if re.fullmatch(r"-{3,}", b.strip())}


def test_all_is_fixed_and_sorted():
    assert voxkernel.__all__ == sorted(voxkernel.__all__)
    assert voxkernel.__all__ == NAMES


def test_every_list_of_names_agrees():
    tree = ast.parse(inspect.getsource(voxkernel))
    (checked,) = [node for node in tree.body if isinstance(node, ast.If)]
    imports = {(a.name, n.module.removeprefix("voxkernel.")) for n in checked.body for a in n.names}
    assert imports == set(voxkernel._HOMES.items())
    assert list(voxkernel._HOMES) == voxkernel.__all__


def test_a_name_is_that_of_its_folder():
    for name, home in voxkernel._HOMES.items():
        assert getattr(voxkernel, name) is getattr(import_module(f"voxkernel.{home}"), name)


def test_folders_are_found_without_an_import():
    files = Path(voxkernel.__file__).parent.glob("*/__init__.py")
    assert set(voxkernel._FOLDERS) == {file.parent.name for file in files} - {"cli"} | {"errors"}
    assert all(getattr(voxkernel, name) is import_module(f"voxkernel.{name}") for name in voxkernel._FOLDERS)


def test_dir_and_unknown_names():
    assert {*NAMES, *voxkernel._FOLDERS, "__version__"} <= set(dir(voxkernel))
    with pytest.raises(AttributeError, match="module 'voxkernel' has no attribute 'exact_kernal'"):
        voxkernel.exact_kernal  # noqa: B018


def loaded_by(code):
    """Modules that a fresh interpreter has afterwards and a bare one does not."""
    show = "import sys; print(*sys.modules)"
    env = {**os.environ, "PYTHONPATH": str(Path(voxkernel.__file__).parents[1])}
    bare, full = (
        subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True, env=env).stdout.split()
        for text in (show, f"{code}; {show}")
    )
    return set(full) - set(bare)


def test_import_loads_neither_numpy_nor_a_folder():
    loaded = loaded_by("import voxkernel")
    assert "numpy" not in loaded
    own = {"voxkernel", "voxkernel._core", "voxkernel._core_check", "voxkernel._version"}
    assert {name for name in loaded if name.startswith("voxkernel")} == own
    assert "voxkernel.exact" in loaded_by("import voxkernel; voxkernel.exact_kernel")


def test_way_in_of_the_command_loads_next_to_nothing():
    loaded = loaded_by("import voxkernel.cli.main")
    assert not {"numpy", "argparse", "typing", "pathlib", "logging", "voxkernel.cli.commands"} & loaded


def test_version():
    assert re.fullmatch(r"\d+\.\d+\.\d+", voxkernel.__version__)


@pytest.mark.parametrize("name", CALLABLES)
def test_docstring_sections(name):
    thing = getattr(voxkernel, name)
    have = sections(name)
    if inspect.isclass(thing):
        needed = {"Parameters", "Examples"} if name in MADE_BY_USERS else set()
        assert have & {"Parameters", "Attributes"}
    else:
        needed = {"Examples"}
        needed |= {"Parameters"} if inspect.signature(thing).parameters else set()
        needed |= {"Raises"}
        returns = typing.get_type_hints(thing).get("return")
        needed |= set() if returns is type(None) else {"Returns"}
    assert needed <= have, f"{name} lacks {sorted(needed - have)}"


@pytest.mark.parametrize("name", CALLABLES)
def test_every_parameter_is_documented(name):
    thing = getattr(voxkernel, name)
    if getattr(thing, "_is_protocol", False):
        fields = [n for n, member in vars(thing).items() if isinstance(member, property)]
    elif inspect.isclass(thing):
        fields = [n for n in inspect.signature(thing).parameters if not n.startswith("_")]
    else:
        fields = list(inspect.signature(thing).parameters)
    doc = inspect.getdoc(thing)
    missing = [f for f in fields if not re.search(rf"^(.*, )?{f}(, .*)? : ", doc, re.MULTILINE)]
    assert not missing, f"{name} does not document {missing}"


@pytest.mark.parametrize("name", [n for n in CALLABLES if n[0].islower()])
def test_options_are_keyword_only_and_typed(name):
    thing = getattr(voxkernel, name)
    for parameter in inspect.signature(thing).parameters.values():
        assert parameter.annotation is not inspect.Parameter.empty
        if parameter.default is not inspect.Parameter.empty:
            assert parameter.kind is inspect.Parameter.KEYWORD_ONLY, f"{name}: {parameter.name}"


def test_every_class_a_public_name_leads_to_is_public():
    # What a user holds in the end has a name to write in an annotation, and a page of its own.
    sys.path.insert(0, str(Path(__file__).parent.parent / "docs" / "_ext"))
    try:
        import api_pages
    finally:
        sys.path.pop(0)
    # These stand on the pages of `voxkernel.grid`, `voxkernel.registration` and `voxkernel.view`.
    assert set(api_pages.result_classes()) == {"NamedGrids", "PreparedSurface", "Rim", "Samples", "Skin", "Viewer"}


@pytest.mark.parametrize("name", [n for n in CALLABLES if n[0].islower()])
def test_a_result_has_one_type(name):
    """Whatever the arguments: no union, not even with None."""
    returned = str(inspect.signature(getattr(voxkernel, name)).return_annotation)
    assert not re.search(r"\||Union|Optional|^Any$", returned), returned


def test_errors_are_one_family():
    from voxkernel import errors

    assert errors.__all__ == ERRORS
    for name in errors.__all__:
        assert issubclass(getattr(errors, name), voxkernel.VoxKernelError)
        assert getattr(voxkernel, name) is getattr(errors, name)
    assert issubclass(errors.MeshError, ValueError)
    assert issubclass(errors.MeshReadError, OSError)
    assert issubclass(errors.SolverError, RuntimeError)
