"""What is published agrees with itself: one version, the authors, the paper, a changelog with the version in it."""

import re
import tomllib
from pathlib import Path

import yaml

import voxkernel

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
RELEASES = dict(re.findall(r"^## \[(\d[^]]*)] - (\S+)$", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.MULTILINE))


def test_the_version_is_written_once():
    assert PROJECT["project"]["dynamic"] == ["version"]
    assert PROJECT["tool"]["dynamic-metadata"][0]["input"] == "voxkernel/_version.py"
    assert voxkernel.__version__ == next(iter(RELEASES))
    assert "release = version = voxkernel.__version__" in (ROOT / "docs/conf.py").read_text(encoding="utf-8")


def test_releases_go_back_in_time():
    dates = list(RELEASES.values())
    assert dates == sorted(dates, reverse=True)
    assert all(re.fullmatch(r"\d{4}-\d\d-\d\d", date) for date in dates)


def test_the_citation_names_this_version_and_the_paper():
    assert CITATION["version"] == voxkernel.__version__
    assert CITATION["date-released"] == RELEASES[voxkernel.__version__]
    (paper,) = CITATION["references"]
    assert (paper["authors"][0]["family-names"], paper["year"]) == ("Werghi", 2008)
    bibliography = (ROOT / "docs/references.bib").read_text(encoding="utf-8")
    assert paper["title"] in bibliography
    assert paper["conference"]["name"] in bibliography


def test_authors_and_license_are_those_of_the_citation():
    assert [a["name"] for a in PROJECT["project"]["authors"]] == [a["name"] for a in CITATION["authors"]]
    assert PROJECT["project"]["license"] == CITATION["license"]
