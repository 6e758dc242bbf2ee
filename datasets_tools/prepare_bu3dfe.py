#!/usr/bin/env python3
"""List the meshes of a copy of BU-3DFE in a manifest, and convert them to .ply where asked for.

BU-3DFE is the 3D facial expression database of Yin, Wei, Sun, Wang and Rosato (Binghamton University, 2006):
100 subjects, 25 models each. It is given out by the authors only; this script reads the copy you have. File
names say what a file is:
  F0001_AN01WH_F3D.wrl
  F0001  subject: F0001 to F0056 female, M0001 to M0044 male
  AN     expression: AN angry, DI disgust, FE fear, HA happy, NE neutral, SA sad, SU surprise
  01     intensity: 01 (low) to 04 (highest); 00 for NE
  WH     ancestry: WH white, AE East Asian, AM Middle-East Asian, IN Indian, BL black, LA Hispanic-Latino
  F3D    kind: F3D the cropped face, RAW the whole scan
FOLDER is searched with all its sub-folders. The manifest has the columns file, label, subject, gender,
expression, intensity, ethnicity, kind and, with --ply, ply; `label` is the expression. .wrl files with other
names are listed on stderr, and the exit code is then 1.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tool

EXAMPLES = (
    "prepare_bu3dfe.py BU_3DFE/ -o bu3dfe.csv",
    "prepare_bu3dfe.py BU_3DFE/ -o bu3dfe.csv --kind F3D --expressions NE,HA --ply bu3dfe_ply/",
)
COLUMNS = ("file", "label", "subject", "gender", "expression", "intensity", "ethnicity", "kind")
EXPRESSIONS = {
    "AN": "angry", "DI": "disgust", "FE": "fear", "HA": "happy", "NE": "neutral", "SA": "sad", "SU": "surprise",
}  # fmt: skip
ETHNICITIES = {
    "WH": "white", "AE": "East Asian", "AM": "Middle-East Asian", "IN": "Indian", "BL": "black",
    "LA": "Hispanic-Latino",
}  # fmt: skip
SUBJECTS = {"F": 56, "M": 44}
_NAME = re.compile(r"([FM])(\d{4})_([A-Z]{2})(\d{2})([A-Z]{2})_(F3D|RAW)\.wrl", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class FaceName:
    """What a file name of BU-3DFE says."""

    subject: str
    gender: str
    expression: str
    intensity: int
    ethnicity: str
    kind: str


def parse_name(name: str) -> FaceName:
    """Read a file name of BU-3DFE.

    Raises
    ------
    ValueError
        If it is none: another form, an unknown code, a subject or an intensity out of range.
    """
    match = _NAME.fullmatch(name)
    if not match:
        raise ValueError(f"`name` must be like F0001_AN01WH_F3D.wrl; got '{name}'")
    sex, number, expression, intensity, ethnicity, kind = (part.upper() for part in match.groups())
    if not 1 <= int(number) <= SUBJECTS[sex]:
        raise ValueError(f"`subject` must be {sex}0001 to {sex}{SUBJECTS[sex]:04d}; got '{sex}{number}'")
    if expression not in EXPRESSIONS:
        raise ValueError(f"`expression` must be one of {', '.join(EXPRESSIONS)}; got '{expression}'")
    if ethnicity not in ETHNICITIES:
        raise ValueError(f"`ethnicity` must be one of {', '.join(ETHNICITIES)}; got '{ethnicity}'")
    if not (int(intensity) == 0 if expression == "NE" else 1 <= int(intensity) <= 4):
        raise ValueError(f"`intensity` must be 00 for NE and 01 to 04 for others; got '{expression}{intensity}'")
    gender = "female" if sex == "F" else "male"
    return FaceName(f"{sex}{number}", gender, expression, int(intensity), ethnicity, kind)


def list_faces(folder: Path) -> tuple[list[dict[str, Any]], list[str]]:
    """Find the meshes of a copy of BU-3DFE.

    Returns
    -------
    rows : list of dict
        Rows of the manifest, sorted by file; `file` is relative to the folder, with forward slashes.
    strange : list of str
        Why other .wrl files are not among them.
    """
    rows: list[dict[str, Any]] = []
    strange: list[str] = []
    for path in sorted(p for p in folder.rglob("*") if p.suffix.lower() == ".wrl" and p.is_file()):
        file = path.relative_to(folder).as_posix()
        try:
            face = parse_name(path.name)
        except ValueError as error:
            strange.append(f"{file}: {error}")
            continue
        rows.append({
            "file": file, "label": EXPRESSIONS[face.expression], "subject": face.subject, "gender": face.gender,
            "expression": face.expression, "intensity": face.intensity, "ethnicity": face.ethnicity,
            "kind": face.kind,
        })  # fmt: skip
    return rows, strange


def convert(folder: Path, rows: list[dict[str, Any]], target: Path, *, quiet: bool = True) -> list[str]:
    """Write each mesh as .ply and add its path as `ply` to its row; returns why some could not be converted.

    Coordinates of .wrl files are read as float32.
    """
    from voxkernel import VoxKernelError, as_mesh

    failed = []
    for n, row in enumerate(rows):
        file = target / Path(row["file"]).with_suffix(".ply")
        try:
            mesh = as_mesh(folder / row["file"])
            file.parent.mkdir(parents=True, exist_ok=True)
            mesh.write(file)
            row["ply"] = file.as_posix()
        except (VoxKernelError, OSError) as error:
            failed.append(f"{row['file']}: {error}")
        tool.progress(n + 1, len(rows), "converted", quiet=quiet)
    return failed


def main(argv: list[str] | None = None) -> int:
    """Parse the arguments and write the manifest."""
    parser = tool.parser(__doc__ or "", EXAMPLES)
    parser.add_argument("folder", metavar="FOLDER", help="the copy of BU-3DFE")
    parser.add_argument("-o", "--output", required=True, metavar="CSV", help="the manifest")
    parser.add_argument("--kind", choices=("F3D", "RAW"), help="only these files")
    parser.add_argument("--expressions", metavar="NE,HA,...", help="only these expressions")
    parser.add_argument("--ply", metavar="FOLDER", help="also convert the meshes listed to .ply in this folder")
    return tool.run(_run, parser.parse_args(argv))


def _run(args: argparse.Namespace) -> int:
    folder = tool.input_folder(args.folder)
    chosen = set(args.expressions.upper().split(",")) if args.expressions else set(EXPRESSIONS)
    if not chosen <= set(EXPRESSIONS):
        raise tool.UsageError(f"--expressions must be some of {', '.join(EXPRESSIONS)}; got '{args.expressions}'")
    rows, problems = list_faces(folder)
    rows = [row for row in rows if row["expression"] in chosen and args.kind in (None, row["kind"])]
    if not rows:
        problems.append(f"no file like F0001_AN01WH_F3D.wrl in '{os.fspath(folder)}'")
    columns = COLUMNS
    if args.ply:
        problems += convert(folder, rows, tool.output_folder(args.ply), quiet=args.quiet)
        columns = (*COLUMNS, "ply")
    tool.write_csv(args.output, columns, rows)
    for problem in problems:
        tool.report_error(problem)
    tool.say(f"{len(rows)} meshes of {len({row['subject'] for row in rows})} subjects", quiet=args.quiet)
    return tool.FAILED if problems else tool.OK


if __name__ == "__main__":
    sys.exit(main())
