"""Several relaxed kernels at once, and one at a time: the type of a result never depends on a value."""

import numpy as np
import pytest
import shapes

from voxkernel import best_center, defect_profile, register, register_many, voxel_kernel, voxel_kernels
from voxkernel.evaluation import EvaluateSettings
from voxkernel.halfspaces import HalfSpaces
from voxkernel.registration import prepare_surface
from voxkernel.voxels import KernelGrid

CUBE = shapes.cube()


@pytest.mark.parametrize("make", [list, tuple, np.array, iter])
def test_any_sequence_gives_a_tuple_in_its_order(make):
    grids = voxel_kernels(CUBE, tolerances=make([0.4, 0.0, 0.2]), depth=4)
    assert isinstance(grids, tuple)
    assert [g.tolerance for g in grids] == [0.4, 0.0, 0.2]
    (alone,) = voxel_kernels(CUBE, tolerances=make([0.2]), depth=4)
    assert isinstance(alone, KernelGrid)
    assert alone.volume_bounds == grids[2].volume_bounds


@pytest.mark.parametrize("step", [{"depth": 5}, {"voxel_size": 0.07}, {"rtol": 0.3}])
@pytest.mark.parametrize("frame", ["world", "principal"])
def test_one_of_several_is_the_one_alone(step, frame):
    surface = shapes.torus()
    one, two = voxel_kernels(surface, tolerances=[0.35, 0.45], frame=frame, **step)
    alone = voxel_kernel(surface, tolerance=0.45, frame=frame, depth=two.depth)
    assert one.depth == two.depth
    if "voxel_size" not in step:
        assert alone.volume_bounds == two.volume_bounds
        assert alone.inside.leaf_ijk.tolist() == two.inside.leaf_ijk.tolist()
    assert one.volume_bounds[0] <= two.volume_bounds[0]
    assert one.volume_bounds[1] <= two.volume_bounds[1]


def test_margins_are_tolerances_above_the_least_violation():
    surface = shapes.torus()
    least = best_center(surface).violation_bounds[1]
    grids = voxel_kernels(surface, margins=[0.1, 0.0, 2.0], depth=4)
    assert [g.tolerance for g in grids] == [least + 0.1, least, 1.0]
    assert grids[0].volume_bounds == voxel_kernel(surface, margin=0.1, depth=4).volume_bounds


def test_tolerance_0_is_the_kernel_within_the_same_domain():
    surface = shapes.l_prism()
    (relaxed,) = voxel_kernels(surface, tolerances=[0.0], depth=5)
    exact = voxel_kernel(surface, depth=5, domain="hull")
    assert relaxed.domain.kind == "hull"
    low, high = exact.volume_bounds
    assert relaxed.volume_bounds[0] <= high
    assert relaxed.volume_bounds[1] >= low


@pytest.mark.parametrize("several", [[0.1, 0.2], (0.1,), np.array([0.1]), []], ids=str)
@pytest.mark.parametrize("name", ["tolerance", "margin"])
def test_one_kernel_refuses_several_and_says_who_takes_them(name, several):
    message = rf"`{name}` must be a real number; got \w+ \(for several: voxel_kernels\(..., {name}s=...\)\)$"
    with pytest.raises(TypeError, match=message):
        voxel_kernel(CUBE, depth=3, **{name: several})


SEVERAL = [
    ("tolerances", lambda v: voxel_kernels(CUBE, tolerances=v)),
    ("margins", lambda v: voxel_kernels(CUBE, margins=v)),
    ("tolerances", lambda v: defect_profile(CUBE, tolerances=v)),
    ("tolerances", lambda v: EvaluateSettings(tolerances=v)),
    ("margins", lambda v: register(CUBE, CUBE, margins=v)),
    ("margins", lambda v: prepare_surface(CUBE, margins=v)),
    ("margins", lambda v: register_many([CUBE, CUBE], margins=v)),
]


@pytest.mark.parametrize(("name", "call"), SEVERAL)
@pytest.mark.parametrize(
    ("value", "error", "match"),
    [
        (0.1, TypeError, "must be a sequence of numbers; got float"),
        (np.array(0.1), TypeError, "must be a sequence of numbers; got ndarray"),
        ([], ValueError, "must hold at least one number; got none"),
        ([0.1, -0.1], ValueError, "must be >= 0; got -0.1"),
        ([0.1, float("nan")], ValueError, "must be finite; got nan"),
        ([[0.1]], TypeError, "must be a real number; got list"),
        ("0.1", TypeError, "must be a real number; got str"),
    ],
)
def test_wrong_sequences_are_refused_alike(name, call, value, error, match):
    with pytest.raises(error, match=f"`{name}` {match}"):
        call(value)


@pytest.mark.parametrize(("name", "call"), [pair for pair in SEVERAL if pair[0] == "tolerances"])
def test_tolerances_are_shares(name, call):
    with pytest.raises(ValueError, match=r"`tolerances` must be at most 1, the whole surface; got 1\.5"):
        call([0.5, 1.5])


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({}, "`tolerances` or `margins` must be given, not both; got neither"),
        ({"tolerances": [0.1], "margins": [0.1]}, "`tolerances` or `margins` must be given, not both; got both"),
        ({"tolerances": [0.1], "depth": 5, "rtol": 0.1}, "`depth`, `voxel_size` and `rtol` must not be given together"),
        ({"tolerances": [0.1], "depth": 2}, r"`depth` must be in 3\.\.20; got 2"),
        ({"tolerances": [0.1], "threads": 0}, r"`threads` must be in 1\.\.256; got 0"),
        ({"tolerances": [0.1], "frame": "own"}, "`frame` must be one of 'world', 'principal'; got 'own'"),
    ],
)
def test_bad_options_of_several(options, match):
    with pytest.raises(ValueError, match=match):
        voxel_kernels(CUBE, **options)


def test_half_spaces_need_a_domain():
    planes = HalfSpaces.from_planes([[1, 0, 0], [0, 1, 0]], [0, 0])
    with pytest.raises(ValueError, match="`domain` must be given for half-spaces; got None"):
        voxel_kernels(planes, tolerances=[0.5])
    with pytest.raises(ValueError, match="`frame` must be 'world' for half-spaces; got 'principal'"):
        voxel_kernels(planes, tolerances=[0.5], frame="principal")
