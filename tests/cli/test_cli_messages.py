"""What the command line says: its own words, a guess at slips, patterns of files, the stage of long work."""

import io
import json
import time

import numpy as np
import pytest
import shapes

from voxkernel import StarCenter, as_mesh
from voxkernel.cli import stages as stages_module
from voxkernel.cli.argument_types import joined
from voxkernel.cli.center import border_note
from voxkernel.cli.commands import COMMANDS, parser
from voxkernel.cli.main import main
from voxkernel.cli.messages import did_you_mean, option_names, spoken
from voxkernel.cli.stages import stages
from voxkernel.halfspaces.domain import as_domain

NAMES = {"voxel_size": "--voxel-size", "mesh": "MESH"}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Two cubes, one of them inside out, as the current folder."""
    monkeypatch.chdir(tmp_path)
    vertices, faces = shapes.cube()
    as_mesh((vertices, faces)).write("cube.ply")
    as_mesh((vertices, np.asarray(faces)[:, ::-1])).write("cubed.ply")
    return tmp_path


def said(capsys, *words):
    """Exit code, stdout, and what the one line of an error says."""
    try:
        code = main([str(w) for w in words])
    except SystemExit as stop:
        code = stop.code
    text = capsys.readouterr()
    return code, text.out, text.err.removeprefix("voxkernel: error: ").rstrip("\n")


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("`voxel_size` must be above 0; got -1", "--voxel-size must be above 0; got -1"),
        ("`path` must be an existing file; got 'a b.ply'", "'a b.ply' does not exist"),
        ("`path` must be an existing file; got 'x': Permission denied", "'x' cannot be opened: Permission denied"),
        ("`path` must be a file; got the folder 'x'", "'x' is a folder, not a file"),
        ("`path` must be a regular file; got the pipe 'x'", "'x' is a pipe, not a regular file"),
        ("`path` must end in one of .off .ply; got 'x.txt'", "'x.txt' must end in one of .off .ply"),
        ("k.npz: `path` must hold a kernel grid", "'k.npz' must hold a kernel grid"),
        ("`run` must be the output of an evaluation; got 'x', which does not exist", "'x' does not exist"),
        ("turn them: repair(mesh, orient=True)", "turn them: `voxkernel repair MESH --orient -o out.ply`"),
        ("the extra `mesh` brings it: `pip install`", "the extra `mesh` brings it: `pip install`"),
        ("`of_no_option` must be 1; got 2", "`of_no_option` must be 1; got 2"),
    ],
)
def test_keywords_become_options(text, wanted):
    assert spoken(text, NAMES) == wanted


def test_every_command_names_its_options():
    for command in COMMANDS:
        sub = parser().parse_args([command, *_least(command)]).parser
        names = option_names(sub)
        assert names["help"] == "--help"
        assert all(name.startswith("-") or name.isupper() for name in names.values()), command


def _least(command):
    """The fewest arguments that parse."""
    return {"register": ["a", "b"], "report": ["run"], "demo": []}.get(
        command, ["a", "-o", "b"] if command in ("labels", "evaluate", "repair") else ["a"]
    )


def test_nearest_words():
    options = ["--depth", "--domain", "--json"]
    assert did_you_mean("unrecognized arguments: --dmain=hull x", options).endswith("; did you mean --domain?")
    for text in ("unrecognized arguments: --frobnicate", "unrecognized arguments: x", "required: MESH"):
        assert did_you_mean(text, options) == text
    far = "argument COMMAND: invalid choice: 'zzz' (choose from 'info', 'score')"
    assert did_you_mean(far) == far


@pytest.mark.parametrize(
    ("words", "start"),
    [
        (["kernal", "cube.ply"], "argument COMMAND: invalid choice: 'kernal'; did you mean kernel? (see "),
        (["kernel", "cube.ply", "--domian", "hull"], "unrecognized arguments: --domian hull; did you mean --domain?"),
        (["kernel", "cube.ply", "--domain", "bxo"], "argument --domain: invalid choice: 'bxo'; did you mean box?"),
        (["evaluate", "cube.ply", "-o", "run", "--depth", "99"], "--depth must be "),
    ],
)
def test_slips(folder, capsys, words, start):
    code, out, err = said(capsys, *words)
    assert (code, out, err.count("\n")) == (2, "", 0)
    assert err.startswith(start)


def test_errors_speak_of_options(folder, capsys):
    assert said(capsys, "kernel", "cube.ply", "--voxel-size", "1e-30")[2].startswith("--voxel-size must be ")
    assert said(capsys, "guards", "cube.ply", "--coverage", "7")[2].startswith("--coverage must be in (0, 1]; got 7")
    assert said(capsys, "info", ".")[2] == "'.' is a folder, not a file"


def test_patterns_are_expanded(folder, capsys):
    code, out, _ = said(capsys, "score", "cube*.ply", "--json")
    assert code == 0
    assert [entry["file"] for entry in json.loads(out)] == ["cube.ply", "cubed.ply"]
    assert "turns them" in json.loads(out)[1]["notes"][0]
    code, out, _ = said(capsys, "info", "cubed*.ply", "--json")
    assert (code, json.loads(out)["file"]) == (0, "cubed.ply")
    code, _, err = said(capsys, "kernel", "cube*.ply")
    assert code == 2
    assert err.startswith("MESH must be one file; got 2: cube.ply, cubed.ply (see ")
    assert said(capsys, "kernel", "none*.ply")[::2] == (1, "'none*.ply' does not exist")


def test_a_file_called_as_a_pattern_is_that_file(folder, capsys):
    (folder / "cube[d].ply").write_bytes((folder / "cube.ply").read_bytes())
    assert json.loads(said(capsys, "info", "cube[d].ply", "--json")[1])["file"] == "cube[d].ply"


def test_meshes_of_other_units_are_noted(folder, capsys):
    vertices, faces = shapes.cube()
    for name, scale in (("large", 5000.0), ("small", 1e-4), ("same", 2.0)):
        as_mesh((np.asarray(vertices) * scale, faces)).write(f"{name}.ply")
    _, out, _ = said(capsys, "score", "cube.ply", "large.ply", "same.ply", "small.ply", "cubed.ply", "--json")
    notes = {entry["file"]: entry["notes"] for entry in json.loads(out)}
    assert notes["large.ply"] == ["5,000 times as large as the median of 5 meshes: other units?"]
    assert notes["small.ply"] == ["10,000 times smaller than the median of 5 meshes: other units?"]
    assert notes["cube.ply"] == notes["same.ply"] == []
    _, out, _ = said(capsys, "info", "cube.ply", "large.ply", "same.ply", "--json")
    assert [document["notes"] for document in json.loads(out)] == [
        [], ["2,500 times as large as the median of 3 meshes: other units?"], []
    ]  # fmt: skip
    err = said(capsys, "info", "cube.ply", "large.ply", "same.ply")[2]
    assert err == "voxkernel: large.ply: 2,500 times as large as the median of 3 meshes: other units?"
    err = said(capsys, "score", "cube.ply", "large.ply", "same.ply")[2]
    assert err == "voxkernel: large.ply: 2,500 times as large as the median of 3 meshes: other units?"


def test_notes_that_save_people(folder, capsys):
    assert "inside out: facets point inwards" in said(capsys, "info", "cubed.ply")[1]
    assert said(capsys, "info", "cube.ply")[1].splitlines()[-1].split() == ["notes", "-"]
    out = said(capsys, "sphere", "cube.ply", "--center", "9,0.5,0.5")[1]
    assert "the centre lies outside the domain (hull), by 8" in out
    assert "outside" not in said(capsys, "sphere", "cube.ply", "--center", "0.5,0.5,0.5")[1]


def test_a_centre_at_the_border_of_its_domain_says_so(folder):
    box = as_domain("box", as_mesh("cube.ply"))
    low, high = box.vertices.min(axis=0), box.vertices.max(axis=0)
    middle = 0.5 * (low + high)

    def center(point, violation=(0.1, 0.2)):
        return StarCenter(np.asarray(point), violation, box, 1, "")

    assert center(middle).border_distance == pytest.approx(0.5 * (high - low).min())
    assert center([high[0], *middle[1:]]).border_distance == pytest.approx(0.0, abs=1e-12)
    assert border_note(center([high[0], *middle[1:]])) == [
        "the point lies on the border of the domain (box), which decides it: try --domain hull"
    ]
    assert border_note(center(middle)) == []
    assert border_note(center(high, (0.0, 0.0))) == []  # it faces everything: nothing to gain outside
    assert border_note(StarCenter(middle, (0.1, 0.2), None, 1, "")) == []


# ---------------------------------------------------------------- repair


def test_repair_turns_and_says_so(folder, capsys):
    assert "`voxkernel repair MESH --orient -o out.ply`" in said(capsys, "score", "cubed.ply")[1]
    code, out, err = said(capsys, "repair", "cubed.ply", "-o", "out.ply")
    assert (code, err) == (0, "voxkernel: wrote out.ply")
    rows = dict(line.split("  ", 1) for line in out.splitlines())
    assert rows["orient"].strip() == "turned 12 triangles"
    assert rows["outward"].strip() == "no -> yes"
    assert as_mesh("out.ply").facts().volume == 1.0
    assert said(capsys, "score", "out.ply")[1].split()[1:3] == ["star-shaped", "1"]


def test_repair_does_only_what_is_asked(folder, capsys):
    document = json.loads(said(capsys, "repair", "cubed.ply", "--merge-duplicates", "-o", "out.ply", "--json", "-q")[1])
    assert [change["step"] for change in document["changes"]] == ["merge_duplicates"]
    assert document["before"] == document["after"]
    assert document["after"]["volume"] == -1.0


def test_repair_errors(folder, capsys):
    assert said(capsys, "repair", "cube.ply", "-o", "cube.ply")[2].startswith("output must not be the mesh itself")
    assert said(capsys, "repair", "cube.ply", "-o", "out.xyz")[2].startswith("output must end in .ply, .obj")
    assert said(capsys, "repair", "cube.ply", "-o", "o.ply", "--close-holes", "1")[2].startswith("--close-holes must ")


# ---------------------------------------------------------------- info


def test_info_reads_a_polyhedral_mesh(folder, capsys):
    (folder / "two.mesh").write_text(
        "MeshVersionFormatted 1\nDimension 3\nVertices\n5\n0 0 0 0\n1 0 0 0\n0 1 0 0\n0 0 1 0\n1 1 1 0\n"
        "Tetrahedra\n2\n1 2 3 4 0\n2 3 4 5 0\nEnd\n"
    )
    document = json.loads(said(capsys, "info", "two.mesh", "--json")[1])
    assert (document["kind"], document["cells"], document["broken_cells"]) == ("polyhedral mesh", 2, 0)
    assert document["highest_corner"] == [1.0, 1.0, 1.0]


@pytest.mark.parametrize("suffix", [".npy", ".npz"])
@pytest.mark.parametrize("axes", [2, 3])
def test_info_reads_label_images(folder, capsys, suffix, axes):
    image = np.zeros((4, 5, 6)[:axes], np.uint16)
    image[(1,) * axes], image[(2,) * axes] = 7, 9
    (np.save if suffix == ".npy" else np.savez)(f"labels{suffix}", image)
    code, out, _ = said(capsys, "info", f"labels{suffix}", "--json")
    assert code == 0
    document = json.loads(out)
    assert (document["kind"], document["axes"], document["objects"]) == ("label image", [4, 5, 6][:axes], 2)
    assert (document["labelled_voxels"], document["spacing"], document["values"]) == (2, None, "uint16")


# ---------------------------------------------------------------- stages


class Terminal(io.StringIO):
    def isatty(self):
        return True


def wait_for(stream, text):
    until = time.monotonic() + 60.0
    while text not in stream.getvalue() and time.monotonic() < until:
        time.sleep(0.01)
    assert text in stream.getvalue()


def test_a_stage_is_named_and_its_line_is_gone_at_the_end(monkeypatch):
    stream = Terminal()
    monkeypatch.setattr(stages_module.sys, "stderr", stream)
    with stages(quiet=False, first=0.0)("reading x.ply"):
        wait_for(stream, "voxkernel: reading x.ply ... 0 s")
    assert stream.getvalue().endswith("\r\x1b[K")


def test_a_stage_is_a_line_where_there_is_no_terminal(monkeypatch):
    stream = io.StringIO()
    monkeypatch.setattr(stages_module.sys, "stderr", stream)
    with stages(quiet=False, plain=0.0)("drawing"):
        wait_for(stream, "voxkernel: drawing ... 0 s\n")
    assert "\x1b" not in stream.getvalue()


def test_what_is_short_or_quiet_says_nothing(monkeypatch):
    stream = Terminal()
    monkeypatch.setattr(stages_module.sys, "stderr", stream)
    with stages(quiet=False)("short"):
        pass
    with stages(quiet=True, first=0.0)("quiet"):
        pass
    assert stream.getvalue() == ""


def test_a_stage_of_a_command_that_has_taken_long_is_named_at_once(monkeypatch):
    """Several short stages one after another: the command is not silent for their sum."""
    stream, clock = Terminal(), [0.0]
    monkeypatch.setattr(stages_module.sys, "stderr", stream)
    monkeypatch.setattr(stages_module.time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(stages_module, "_LEAST", 0.01)
    stage = stages(quiet=False, first=30.0)
    with stage("one"):
        clock[0] = 31.0
    assert stream.getvalue() == ""
    with stage("two") as rename:
        monkeypatch.undo()
        monkeypatch.setattr(stages_module.sys, "stderr", stream)
        wait_for(stream, "voxkernel: two ... ")
        rename("two, half done")
        wait_for(stream, "voxkernel: two, half done ... ")


def test_a_stage_ends_with_its_error(monkeypatch):
    stream = Terminal()
    monkeypatch.setattr(stages_module.sys, "stderr", stream)

    def fail():
        with stages(quiet=False, first=0.0)("failing"):
            wait_for(stream, "failing")
            raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        fail()
    assert stream.getvalue().endswith("\r\x1b[K")


def test_a_file_that_fails_does_not_stop_info_about_others(folder, capsys):
    (folder / "nothing.ply").write_bytes(b"")
    code, out, _ = said(capsys, "info", "cube.ply", "nothing.ply", "lost.ply", "cube.ply", "--json")
    documents = json.loads(out)
    assert code == 1
    assert documents[0] == documents[3]
    assert documents[1]["error"].startswith("'nothing.ply' cannot be read")
    assert documents[2]["error"] == "'lost.ply' does not exist"
    code, out, err = said(capsys, "info", "lost.vdb", "cube.ply")
    assert code == 1
    assert "closed" in out
    assert err.splitlines() == ["'lost.vdb' does not exist", "voxkernel: 1 of 2 files failed"]


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (["--up", "-z"], ["--up=-z"]),
        (["--center", "-0.1,0,2"], ["--center=-0.1,0,2"]),
        (["--center", "-.5,0,2", "x.ply"], ["--center=-.5,0,2", "x.ply"]),
        (["x.ply", "-z"], ["x.ply", "-z"]),
        (["--up=x", "-z"], ["--up=x", "-z"]),
        (["--picture", "-v", "--up", "y"], ["--picture", "-v", "--up", "y"]),
        (["-o", "-1,2,3"], ["-o", "-1,2,3"]),
        ([], []),
    ],
)
def test_a_value_may_begin_with_a_minus(words, wanted):
    assert joined(words) == wanted


def test_a_centre_below_zero_and_a_picture_upside_down(folder, capsys):
    as_mesh((shapes.cube()[0] - 0.6, shapes.cube()[1])).write("low.ply")
    code, out, _ = said(capsys, "sphere", "low.ply", "--center", "-0.1,-0.1,-0.1", "-q")
    assert code == 0, out
    for up in ("-z", "-1,0,0"):
        assert parser().parse_args(joined(["kernel", "low.ply", "--up", up])).up[2 if up == "-z" else 0] == -1.0
    code, _, err = said(capsys, "kernel", "low.ply", "--up", "-q")
    assert (code, err) == (2, "argument --up: expected one argument (see `voxkernel kernel --help`)")
