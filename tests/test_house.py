"""The package as a reader meets it: no long files, and no names that say nothing of the thing.

The numbers below are what there was when they were written. They may only fall: a new name says
what the thing is (`gaps`, `converged_roots`, `MIN_ROWS_PER_PERIOD`), and who renames
some lowers the number.
"""

import ast
from collections import Counter
from functools import cache
from pathlib import Path

import pytest

import squealstudy

PACKAGE = Path(squealstudy.__file__).parent
FILES = sorted(PACKAGE.rglob("*.py"))
MAX_LINES = 400
LONGER = {  # may only fall, and becomes none
    "kinds/complex_modes/onsets.py": 416,
    "models/components/file_tables.py": 420,
}


def ceilings(text):
    """How often each word may be there, of "word count, word count"."""
    return {word: int(count) for word, count in map(str.split, text.split(","))}


# words that name no function, class or constant of a module; else how often they still do
MODULE_NAMES = ceilings(
    """
    place 13, least 10, most 10, apart 9, found 9, nothing 9, whole 9, kept 8, reach 8, shown 8,
    named 7, round_off 7, same 7, batch 6, edge 6, finer 6, near 6, safety 6, alike 5, beside 5,
    close 5, far 5, known 5, margin 5, own 5, places 5, small 5, back 4, block 4, deepest 4,
    drawn 4, exact 4, few 4, held 4, largest 4, listed 4, longest 4, others 4, told 4, left 3,
    more 3, part 3, parts 3, seen 3, share 3, steady 3, beyond 2, drift 2, item 2, large 2,
    loose 2, lowest 2, made 2, many 2, moved 2, noise 2, other 2, sharp 2, shortest 2, still 2,
    taken 2, tight 2, value 2, wanted 2, written 2, ask 0, asked 0, besides 0, big 0, data 0,
    given 0, helper 0, highest 0, info 0, less 0, manager 0, misc 0, obj 0, result 0, rough 0,
    safe 0, smallest 0, some 0, steeper 0, stuff 0, temp 0, thing 0, tmp 0, trend 0, util 0,
    utils 0
    """
)
# words that name no variable of a function; else how often they are still assigned
LOCAL_NAMES = ceilings(
    """
    found 756, own 417, known 197, value 167, left 113, kept 105, told 104, held 73, seen 67,
    moved 62, wanted 62, made 60, given 59, asked 49, result 16, data 13, item 13, info 10, foo
    0, obj 0, stuff 0, temp 0, thing 0, tmp 0
    """
)


@cache
def trees():
    return {p.relative_to(PACKAGE).as_posix(): ast.parse(p.read_text("utf-8")) for p in FILES}


def stored(target):
    """Names that an assignment makes."""
    return [n.id for n in ast.walk(target) if isinstance(n, ast.Name)]


def module_names(tree):
    """Functions, classes and variables at the top of a module, private ones too."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.Assign):
            yield from (name for target in node.targets for name in stored(target))
        elif isinstance(node, ast.AnnAssign):
            yield from stored(node.target)


def local_names(tree):
    """Variables that functions assign."""
    functions = (n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef))
    within = {id(node): node for function in functions for node in ast.walk(function)}
    for node in within.values():
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id


def uses(names_of):
    """How often each name is given, and where, by the name in small letters."""
    counts, places = Counter(), {}
    for path, tree in trees().items():
        for name in names_of(tree):
            word = name.strip("_").lower()
            counts[word] += 1
            places.setdefault(word, Counter())[path] += 1
    return counts, places


@pytest.mark.parametrize(
    ("names_of", "ceilings"), [(module_names, MODULE_NAMES), (local_names, LOCAL_NAMES)]
)
def test_words_that_say_nothing_become_fewer(names_of, ceilings):
    counts, places = uses(names_of)
    over = [
        f"{word}: {counts[word]}, at most {ceiling}; most in {places[word].most_common(5)}"
        for word, ceiling in ceilings.items()
        if counts[word] > ceiling
    ]
    assert not over, "name what the thing is:\n" + "\n".join(over)


def test_no_file_is_long():
    lines = {
        path.relative_to(PACKAGE).as_posix(): len(path.read_text("utf-8").splitlines())
        for path in FILES
    }
    long = {p: n for p, n in lines.items() if n > LONGER.get(p, MAX_LINES)}
    assert not long, f"split by what they are about: {long}"
