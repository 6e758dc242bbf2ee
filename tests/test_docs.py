"""The pages of the site: their Python runs, the names and links in them exist, every public name has a page.

The gallery runs when the site is built, not here.
"""

import importlib
import inspect
import re
import runpy
import shlex
from pathlib import Path

import pytest
from docs_extensions import extension

import voxkernel

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
PAGES = sorted(p for p in DOCS.rglob("*.md") if not {"_build", "made"} & set(p.relative_to(DOCS).parts))
SCRIPTS = sorted([*DOCS.glob("gallery*/plot_*.py"), *DOCS.glob("_ext/*.py"), DOCS / "conf.py"])
TEXTS = [*PAGES, ROOT / "CONTRIBUTING.md", ROOT / "README.md"]
NOT_RUN = "# Not run by the tests:"
WORDS = {"voxkernel.css"}


def name_of(path):
    return path.relative_to(ROOT).as_posix()


def blocks(path, language):
    return re.findall(rf"^```{language}\n(.*?)^```$", path.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def python_of(path):
    return [text for text in blocks(path, "python") if not text.startswith(NOT_RUN)]


@pytest.fixture(scope="module")
def api_pages():
    with extension("api_pages") as module:
        yield module


@pytest.mark.parametrize("page", [p for p in PAGES if python_of(p)], ids=name_of)
def test_python_of_a_page_runs(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    script = tmp_path / "page.py"
    script.write_text("\n".join(python_of(page)), encoding="utf-8")
    runpy.run_path(str(script), run_name="__main__")


def resolve(dotted):
    """Import as much as is a module, then look up the rest."""
    parts = dotted.split(".")
    for n in range(len(parts), 0, -1):
        try:
            thing = importlib.import_module(".".join(parts[:n]))
        except ModuleNotFoundError:
            continue
        for part in parts[n:]:
            thing = getattr(thing, part)
        return thing
    raise AttributeError(dotted)


def names_in(path):
    """Every `voxkernel.x` of a file that is meant as Python, and every import from it."""
    text = path.read_text(encoding="utf-8")
    found = set(re.findall(r"(?<![\w/.-])voxkernel(?:\.[A-Za-z_]\w*)+", text)) - WORDS
    for module, names in re.findall(r"^\s*from (voxkernel[\w.]*) import ([\w, ]+)$", text, re.MULTILINE):
        found |= {f"{module}.{name.split(' as ')[0].strip()}" for name in names.split(",")}
    return sorted(found)


@pytest.mark.parametrize("path", [*TEXTS, *SCRIPTS], ids=name_of)
def test_names_exist(path):
    for dotted in names_in(path):
        assert resolve(dotted) is not None, dotted


def test_commands_parse():
    from voxkernel.cli import commands as cli

    parser = cli.parser()
    lines = [line for path in TEXTS for text in blocks(path, "sh") for line in text.splitlines()]
    own = [line.split("&&")[-1] for line in lines if re.match(r"(.*&& )?voxkernel ", line)]
    commands = [shlex.split(line, comments=True) for line in own]
    assert commands
    for words in commands:
        parser.parse_args(words[1:])


LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")


@pytest.mark.parametrize("path", TEXTS, ids=name_of)
def test_links_lead_somewhere(path):
    text = re.sub(r"^```.*?^```$", "", path.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    for link in LINK.findall(text):
        target = link.split("#")[0]
        if not target or re.match(r"[a-z]+:", target):
            continue
        inside = re.match(r"(?:\.\./)*made/(gallery|api|notebooks)/(.*?)(?:\.rst|\.md)?$", target)
        if inside:
            assert is_made(*inside.groups()), f"{link}: no such page is made"
        else:
            assert (path.parent / target).exists(), link


def is_made(part, name):
    """Whether the site's build makes that page."""
    if part == "gallery":
        return name == "index" or (DOCS / "gallery" / f"{name}.py").exists()
    if part == "notebooks":
        return (DOCS / "notebooks" / f"{name}.ipynb").exists()
    stem = name.split("/")[-1].removeprefix("module_")
    return name == "index" or stem in voxkernel.__all__ or name.startswith(("classes/", "module_"))


@pytest.mark.parametrize("script", sorted(DOCS.glob("gallery*/plot_*.py")), ids=name_of)
def test_gallery_scripts_draw_and_say_their_limits(script):
    text = script.read_text(encoding="utf-8")
    assert re.match(r'"""\n.+\n=+\n', text), "title first"
    assert ".png" in text, "no picture"
    assert "# Limits\n# ------" in text, "no limits"
    assert re.search(r"^# Sources?\b", text, re.MULTILINE), "no source"
    for target in re.findall(r":doc:`(?:[^<`]*<)?/?([^>`]+)>?`", text):
        if not target.startswith("made/"):
            homes = (DOCS / f"{target}.md", script.parent / f"{target}.py")
            assert any(h.exists() for h in homes), f"{target}: no such page"


def test_every_public_name_has_a_page(api_pages, tmp_path):
    api_pages.write_pages(tmp_path)
    index = (tmp_path / "index.rst").read_text(encoding="utf-8")
    for name in voxkernel.__all__:
        file = f"classes/{name}" if inspect.isclass(getattr(voxkernel, name)) else name
        page = (tmp_path / f"{file}.rst").read_text(encoding="utf-8")
        assert f"voxkernel.{name}\n" in page
        assert f"\n   {file}\n" in index


def test_every_page_is_in_the_contents():
    index = (DOCS / "index.md").read_text(encoding="utf-8")
    listed = {entry for text in re.findall(r"```{toctree}\n(.*?)```", index, re.DOTALL) for entry in text.split()}
    for page in PAGES:
        stem = page.relative_to(DOCS).with_suffix("").as_posix()
        assert stem in listed | {"index", "api/openvdb_names"}, stem


def test_citation_file():
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    fields = dict(re.findall(r"^([a-z-]+): *(.*)$", text, re.MULTILINE))
    assert fields["cff-version"] == "1.2.0"
    assert fields["version"] == voxkernel.__version__
    assert fields["license"] == "Apache-2.0"
    assert {"message", "title", "authors", "date-released", "references"} <= set(fields)
    assert '- name: "The voxkernel developers"' in text
    assert "\t" not in text


def test_references_agree():
    bib = (DOCS / "references.bib").read_text(encoding="utf-8")
    page = (DOCS / "references.md").read_text(encoding="utf-8")
    assert bib.count("{") == bib.count("}")
    entries = re.findall(r"@\w+\{(\w+?)(\d{4}),", bib)
    assert len(entries) == len({a + y for a, y in entries}) >= 15
    for _, year in entries:
        assert year in page


def test_link_checker(tmp_path):
    checker = runpy.run_path(str(DOCS / "check_links.py"))
    (tmp_path / "a.html").write_text('<p id="x"><a href="b.html#y">1</a><a href="#x">2</a><a href="https://e.org/">3</a>')
    (tmp_path / "b.html").write_text('<p id="y"><img src="none.png"><a href="a.html#z">4</a>')
    assert checker["broken_links"](tmp_path) == ["b.html: none.png", "b.html: a.html#z"]
    assert checker["main"]([str(tmp_path)]) == 1
    assert checker["main"]([]) == 2
