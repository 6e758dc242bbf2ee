"""Messages in the words of the command line: options instead of keywords, a guess at slips."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterable, Mapping
from difflib import get_close_matches

__all__ = ["did_you_mean", "option_names", "spoken"]

# Keywords of the library whose option has another name.
_OTHER_NAMES = {
    "max_megabytes": "max-megabytes", "n_rays": "rays", "n_views": "views", "n_worst": "worst",
    "star_labels": "star-label",
}  # fmt: skip
_FILES = (
    (r"`\w+` must be an existing file; got '(.*)'", r"'\1' does not exist"),
    (r"`\w+` must be an existing file; got (.*): (.*?)", r"\1 cannot be opened: \2"),
    (r"`\w+` must be .*; got ('.*'), which does not exist", r"\1 does not exist"),
    (r"`\w+` must be a file; got the folder ('.*')", r"\1 is a folder, not a file"),
    (r"`\w+` must be a regular file; got the (\w+) ('.*')", r"\2 is a \1, not a regular file"),
    (r"(.*): `path` (must .*)", r"'\1' \2"),
    (r"`path` (must .*); got ('.*')", r"\2 \1"),
)
_CHOICE = re.compile(r"invalid choice: '(?P<word>.*)' \(choose from (?P<known>.*)\)")
_REPAIR = re.compile(r"repair\(mesh, (?P<option>\w+)=True\)")


def option_names(parser: argparse.ArgumentParser) -> dict[str, str]:
    """How each keyword is called on the command line: ``--voxel-size`` for `voxel_size`, ``MESH`` for `mesh`."""
    names: dict[str, str] = {}
    for action in parser._actions:
        longest = max(action.option_strings, key=len, default=None)
        names[action.dest] = longest or str(action.metavar or action.dest)
    options = set(names.values())
    return names | {k: f"--{v}" for k, v in _OTHER_NAMES.items() if f"--{v}" in options}


def spoken(text: str, names: Mapping[str, str]) -> str:
    """Say what the library said to a reader who typed a command.

    Parameters
    ----------
    text : str
        A message of the library: `` `voxel_size` must be ...; got ...``.
    names : mapping of str to str
        What `option_names` gives for the command.

    Returns
    -------
    str
        The same with the command's own words; keywords that the command has no option for stay.

    Examples
    --------
    >>> spoken("`voxel_size` must be above 0; got 0", {"voxel_size": "--voxel-size"})
    '--voxel-size must be above 0; got 0'
    >>> spoken("`path` must be an existing file; got 'x.ply'", {})
    "'x.ply' does not exist"
    """
    for pattern, said in _FILES:
        found = re.fullmatch(pattern, text, re.DOTALL)
        if found:
            return found.expand(said)
    text = _REPAIR.sub(lambda m: f"`voxkernel repair MESH --{m['option'].replace('_', '-')} -o out.ply`", text)
    return re.sub(r"`(\w+)`(?! brings it)", lambda m: names.get(m[1], m[0]), text)


def did_you_mean(text: str, options: Iterable[str] = ()) -> str:
    """Add the nearest word to a message of `argparse` about a word that it does not know.

    Parameters
    ----------
    text : str
        What `argparse` says.
    options : iterable of str
        Options of the command.

    Returns
    -------
    str
        The same, with a guess behind it where one is near.

    Examples
    --------
    >>> did_you_mean("unrecognized arguments: --deppth", ["--depth", "--domain"])
    'unrecognized arguments: --deppth; did you mean --depth?'
    >>> did_you_mean("argument COMMAND: invalid choice: 'scroe' (choose from 'score', 'info')")
    "argument COMMAND: invalid choice: 'scroe'; did you mean score?"
    """
    found = _CHOICE.search(text)
    if found:
        near = get_close_matches(found["word"], [w.strip(" '") for w in found["known"].split(",")], n=1)
        return f"{text[: found.start()]}invalid choice: '{found['word']}'; did you mean {near[0]}?" if near else text
    words = text.partition("unrecognized arguments: ")[2].split()
    for word in words:
        bare = {option.lstrip("-"): option for option in options if option.startswith("--")}
        near = get_close_matches(word.partition("=")[0].strip("-"), list(bare), n=1) if word.startswith("-") else []
        if near:
            return f"{text}; did you mean {bare[near[0]]}?"
    return text
