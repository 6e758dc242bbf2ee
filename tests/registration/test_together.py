"""Many scans: poses, strangers, order, loops, the tree by itself, the joint refinement, and what is refused."""

import json

import numpy as np
import pytest
import shapes
from motions import moved, pose
from scipy.spatial.transform import Rotation

from voxkernel import JointRegistration, register_together
from voxkernel.demo_shapes import face
from voxkernel.registration import prepare_surface
from voxkernel.registration.joint_refinement import refined_together
from voxkernel.registration.pose_tree import Edge, Scans, pose_tree
from voxkernel.registration.search import inverse, rotation_angle_deg
from voxkernel.registration.shortlist import compared, describe, ranked_pairs, shortlist


def strips():
    """Three strips of a face, each overlapping the next, of triangles and noise of their own; poses to the face."""
    scans, truths = [], []
    for k, (low, high) in enumerate([(-2.0, 0.25), (-0.55, 0.6), (-0.1, 2.0)]):
        mesh = face(hook=0.2, rings=36 + 3 * k, sectors=70 + 7 * k)
        middles = mesh.vertices[mesh.faces].mean(axis=1)[:, 1]
        noise = 0.001 * np.random.default_rng(k).normal(size=mesh.vertices.shape)
        away = pose(40 + k, 3.0)
        scans.append((moved(away, mesh.vertices + noise), mesh.faces[(middles > low) & (middles < high)]))
        truths.append(inverse(away))
    return scans, truths


@pytest.fixture(scope="module")
def together():
    """Strips 0, 1, a stranger, strip 2; and what was found."""
    scans, truths = strips()
    scans.insert(2, shapes.torus(n_major=40, n_minor=24))
    truths.insert(2, None)
    return scans, truths, register_together(scans)


def check(found, truths, order):
    for i in order:
        true = inverse(truths[order[0]]) @ truths[i]
        ours = inverse(found.poses[order[0]]) @ found.poses[i]
        assert rotation_angle_deg(ours, true) < 0.5
        assert np.abs(moved(ours @ inverse(true), np.eye(3)) - np.eye(3)).max() < 0.03


def test_strips_are_laid_together_and_a_stranger_stays_apart(together):
    _, truths, found = together
    assert isinstance(found, JointRegistration)
    assert found.reference == 0
    np.testing.assert_array_equal(found.poses[0], np.eye(4))
    check(found, truths, [0, 1, 3])
    assert found.apart == (2,)
    assert np.isnan(found.poses[2]).all()
    assert "belongs to nothing" in found.reasons[2]
    assert [bool(r) for r in found.reasons] == [False, False, True, False]
    assert found.groups == ((0, 1, 3),)
    assert found.residual <= found.tree_residual
    used = [p for p in found.pairs if p.use in ("tree", "loop")]
    assert {(p.source, p.target) for p in used} >= {(0, 1), (1, 3)}
    assert all(p.reason == "" for p in used)
    assert all(p.reason for p in found.pairs if p not in used)
    assert all(2 not in (p.source, p.target) for p in used)
    assert len(found.pairs) == 6
    assert "3 of 4 scans" in repr(found)
    assert "'tree'" in repr(used[0])


def nearly_symmetric():
    """Five views of a body that lies nearly on itself after half a turn about any axis, with noise."""
    rng = np.random.default_rng(3)
    vertices, faces = shapes.icosphere(4)
    radius = np.ones(len(vertices))
    for _ in range(6):
        way = rng.normal(size=3)
        radius += rng.uniform(-0.25, 0.25) * np.exp(rng.uniform(6, 14) * (vertices @ (way / np.linalg.norm(way)) - 1))
    vertices = vertices * radius[:, None] * [0.62, 1.5, 0.66]
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    views, truths = [], []
    for k in range(5):
        angle = 2 * np.pi * k / 5
        used, part = np.unique(faces[normals @ [np.cos(angle), 0, np.sin(angle)] > 0.15], return_inverse=True)
        away = pose(30 + k, 5.0)
        noise = 0.002 * np.random.default_rng(k).normal(size=(len(used), 3))
        views.append((moved(away, vertices[used] + noise), part.reshape(-1, 3)))
        truths.append(inverse(away))
    return views, truths


def test_what_lies_nearly_as_well_another_way_is_not_believed():
    """Wrong motions lay smooth parts on each other within a hundredth: pairs are judged as `register` judges them."""
    views, truths = nearly_symmetric()
    found = register_together(views)
    assert found.apart == ()
    for k in range(1, 5):
        assert rotation_angle_deg(inverse(found.poses[0]) @ found.poses[k], inverse(truths[0]) @ truths[k]) < 1.0
    right = [p for p in found.pairs if p.verdict == "right"]
    assert len(right) >= 4
    for pair in right:
        true = inverse(truths[pair.target]) @ truths[pair.source]
        assert rotation_angle_deg(pair.T_target_source, true) < 3.0


def test_merged_and_json(together):
    scans, _, found = together
    merged = found.merged(scans)
    assert len(merged.faces) == sum(len(scans[i][1]) for i in (0, 1, 3))
    np.testing.assert_allclose(merged.bounds[0], moved(np.eye(4), merged.used_vertices).min(axis=0))
    document = json.loads(json.dumps(found.to_dict()))
    assert document["apart"] == [2]
    assert document["poses"][2] is None
    np.testing.assert_allclose(document["poses"][1], found.poses[1])
    with pytest.raises(ValueError, match="`surfaces` must be the 4 that were registered; got 2"):
        found.merged(scans[:2])


@pytest.fixture(scope="module")
def client():
    """A Dask cluster of one thread in this process."""
    distributed = pytest.importorskip("distributed")
    quiet = {"dashboard_address": None, "silence_logs": 60, "n_workers": 1, "threads_per_worker": 1}
    quiet |= {"scheduler_kwargs": {"dashboard": False, "dashboard_address": "127.0.0.1:0"}}
    with distributed.LocalCluster(processes=False, **quiet) as cluster:
        with distributed.Client(cluster, set_as_default=False) as found:
            yield found


def test_order_and_units_decide_only_the_frame_and_a_cluster_finds_the_same(client):
    scans, _ = strips()
    found = register_together(scans)
    order, unit, steps = [2, 0, 1], 1000.0, []
    again = register_together(
        [(unit * scans[i][0], scans[i][1]) for i in order], client=client,
        progress=lambda done, total: steps.append((done, total)),
    )  # fmt: skip
    assert (again.apart, again.reference) == ((), 0)
    for place, i in enumerate(order):
        expected = inverse(found.poses[2]) @ found.poses[i]
        np.testing.assert_allclose(again.poses[place][:3, :3], expected[:3, :3], atol=1e-6)
        np.testing.assert_allclose(again.poses[place][:3, 3], unit * expected[:3, 3], atol=1e-6 * unit)
    assert again.residual == pytest.approx(unit * found.residual, rel=1e-6)
    uses = {frozenset((order[p.source], order[p.target])): p.use for p in again.pairs}
    assert uses == {frozenset((p.source, p.target)): p.use for p in found.pairs}
    assert [done for done, _ in steps] == list(range(1, len(steps) + 1))
    assert steps[-1][0] == steps[-1][1]


@pytest.mark.slow
def test_order_of_scans_does_not_matter_with_a_stranger_among_them(together):
    scans, _, found = together
    order = [3, 2, 0, 1]
    again = register_together([scans[i] for i in order])
    assert (again.apart, again.reference) == ((1,), 0)
    for place, i in enumerate(order):
        if i != 2:
            np.testing.assert_allclose(again.poses[place], inverse(found.poses[3]) @ found.poses[i], atol=1e-6)


def test_surfaces_that_cannot_be_used_have_a_reason():
    flat = (np.zeros((3, 3)), [[0, 1, 2]])
    found = register_together([flat, flat])
    assert found.apart == (0, 1)
    assert all(found.reasons)
    assert found.groups == ()
    assert np.isnan(found.residual)
    assert found.pairs[0].use == "not tried"


def test_bad_input():
    with pytest.raises(ValueError, match="`surfaces` must be at least two; got 1"):
        register_together([shapes.cube()])
    with pytest.raises(ValueError, match="`pairs` must be 'shortlist' or 'all'; got 'some'"):
        register_together([shapes.cube()] * 2, pairs="some")
    with pytest.raises(ValueError, match="`neighbors` must be"):
        register_together([shapes.cube()] * 2, neighbors=0)
    with pytest.raises(ValueError, match="`workers` must be"):
        register_together([shapes.cube()] * 2, workers=0)


# ---------------------------------------------------------------- the tree by itself


def ring(n, seed=0):
    """Poses of n scans, and the scans."""
    poses = np.stack([pose(100 * seed + k, 5.0) for k in range(n)])
    return poses, Scans(np.random.default_rng(seed).normal(size=(n, 3)), 1.0)


def edge(poses, i, j, evidence, wrong=None):
    true = inverse(poses[j]) @ poses[i]
    return Edge(i, j, true if wrong is None else pose(wrong) @ true, evidence)


def laid(found, poses, scans):
    start = scans[0]
    for i in scans:
        ours = inverse(found.poses[start]) @ found.poses[i]
        np.testing.assert_allclose(ours, inverse(poses[start]) @ poses[i], atol=1e-9)


def test_wrong_edge_loses_against_the_loops_of_the_right_ones():
    """The heaviest edge of all is wrong; four right ones around it say so."""
    poses, scans = ring(4)
    edges = [edge(poses, i, j, 3.0) for i, j in [(0, 1), (1, 2), (2, 3), (0, 2), (1, 3)]]
    edges.append(edge(poses, 0, 3, 5.0, wrong=7))
    found = pose_tree(scans, edges)
    assert found.roots.tolist() == [0, 0, 0, 0]
    laid(found, poses, [0, 1, 2, 3])
    assert 5 not in found.tree + found.loops
    assert len(found.tree) == 3
    assert sorted(found.tree + found.loops) == [0, 1, 2, 3, 4]


def test_uncertain_edges_join_only_where_they_agree():
    poses, scans = ring(3)
    alone = pose_tree(scans, [edge(poses, 0, 1, 4.0), edge(poses, 1, 2, 0.5)])
    assert alone.roots.tolist() == [0, 0, 2]
    both = pose_tree(scans, [edge(poses, 0, 1, 4.0), edge(poses, 1, 2, 0.5), edge(poses, 0, 2, 0.5)])
    assert both.roots.tolist() == [0, 0, 0]
    laid(both, poses, [0, 1, 2])
    apart = pose_tree(scans, [edge(poses, 0, 1, 4.0), edge(poses, 1, 2, 0.5), edge(poses, 0, 2, 0.5, wrong=3)])
    assert apart.roots.tolist() == [0, 0, 2]


def test_many_uncertain_edges_do_not_join_where_others_contradict():
    """As between two halves of a thing that is like its own image: half a turn fits about as well."""
    poses, scans = ring(4)
    sure = [edge(poses, 0, 1, 4.0), edge(poses, 2, 3, 4.0)]
    weak = [edge(poses, 0, 2, 1.0), edge(poses, 0, 3, 1.3), edge(poses, 1, 2, 0.5)]
    assert pose_tree(scans, sure + weak).roots.tolist() == [0, 0, 0, 0]
    doubted = [*sure, *weak, edge(poses, 1, 3, 0.0, wrong=3)]
    assert pose_tree(scans, doubted).roots.tolist() == [0, 0, 2, 2]


def test_two_things_are_two_groups():
    poses, scans = ring(5)
    found = pose_tree(scans, [edge(poses, 0, 3, 4.0), edge(poses, 1, 2, 4.0), edge(poses, 2, 4, 4.0)])
    assert found.roots.tolist() == [0, 1, 1, 0, 1]
    laid(found, poses, [1, 2, 4])
    none = pose_tree(scans, [])
    assert none.roots.tolist() == [0, 1, 2, 3, 4]
    assert none.tree == none.loops == ()


# ---------------------------------------------------------------- shortlist and refinement


def test_likeness_knows_what_belongs_together_and_not_the_pose():
    scans, _ = strips()
    scans.append(shapes.torus(n_major=40, n_minor=24))
    shown = [describe(prepare_surface(s), 2.0) for s in scans]
    table = np.array([[compared(a, b).value for b in shown] for a in shown])
    assert min(table[0, 1], table[1, 2]) > 2 * max(table[3, :3])
    turned = (moved(pose(8, 20.0), np.asarray(scans[0][0])), scans[0][1])
    assert compared(describe(prepare_surface(turned), 2.0), shown[1]).value == pytest.approx(table[0, 1], rel=0.05)


def test_shortlist_holds_everything_together():
    """Two clusters of three: the nearest of each scan are in its own, and one pair joins them."""
    table = np.full((6, 6), 1.0)
    table[:3, :3] = table[3:, 3:] = 5.0
    table[2, 4] = table[4, 2] = 2.0
    assert shortlist(table, 2) == [(0, 1), (0, 2), (1, 2), (2, 4), (3, 4), (3, 5), (4, 5)]
    assert len(shortlist(table, 99)) == 15
    assert ranked_pairs(table)[6] == (2, 4)


def test_refinement_never_gets_worse_and_finds_back():
    scans, truths = strips()
    surfaces = [prepare_surface(s) for s in scans]
    right = np.stack([truths[k] @ s.T_world_local for k, s in enumerate(surfaces)])
    right = inverse(right[0]) @ right
    for seed in range(3):
        rng = np.random.default_rng(seed)
        start = right.copy()
        for k in (1, 2):
            nudge = np.eye(4)
            nudge[:3, :3] = Rotation.from_rotvec(rng.normal(size=3) * 0.03).as_matrix()
            nudge[:3, 3] = rng.normal(size=3) * 0.01
            start[k] = start[k] @ nudge
        ends = refined_together(surfaces, start, 2.0)
        assert ends.after <= ends.before
        assert rotation_angle_deg(ends.poses[2], right[2]) < 0.5
    # Far apart nothing pulls, and nothing moves.
    far = right.copy()
    far[1:, :3, 3] += [[100.0, 0, 0], [0, 100.0, 0]]
    ends = refined_together(surfaces, far, 2.0)
    np.testing.assert_array_equal(ends.poses, far)
    assert np.isnan(ends.after)
