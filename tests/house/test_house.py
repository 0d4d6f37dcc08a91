"""The package as a reader meets it: no long files, and no names that say nothing of the thing.

The numbers below are what there was when they were written. They may only fall: a new name says
what the thing is (`gaps`, `converged_roots`, `MIN_ROWS_PER_PERIOD`), and who renames
some lowers the number.
"""

import ast
import re
from collections import Counter
from functools import cache
from pathlib import Path

import pytest

import squealstudy

PACKAGE = Path(squealstudy.__file__).parent
FILES = sorted(PACKAGE.rglob("*.py"))
MAX_LINES = 400


def ceilings(text):
    """How often each word may be there, of "word count, word count"."""
    return {word: int(count) for word, count in map(str.split, text.split(","))}


# words that name no function, class or constant of a module; else how often they still do
MODULE_NAMES = ceilings(
    """
    place 4, shown 4, far 2, left 1, nothing 2, whole 2, close 1, drift 1, found 1, listed 1,
    made 1, named 1, near 1, others 1, own 1, parts 1, places 1, told 1, value 1, alike 0, apart
    0, ask 0, asked 0, back 0, batch 0, beside 0, besides 0, beyond 0, big 0, block 0, data 0,
    deepest 0, drawn 0, edge 0, exact 0, few 0, finer 0, given 0, held 0, helper 0, highest 0,
    info 0, item 0, kept 0, known 0, large 0, largest 0, least 0, less 0, longest 0, loose 0,
    lowest 0, manager 0, many 0, margin 0, misc 0, more 0, most 0, moved 0, noise 0, obj 0,
    other 0, part 0, reach 0, result 0, rough 0, round_off 0, safe 0, safety 0, same 0, seen 0,
    share 0, sharp 0, shortest 0, small 0, smallest 0, some 0, steady 0, steeper 0, still 0,
    stuff 0, taken 0, temp 0, thing 0, tight 0, tmp 0, trend 0, util 0, utils 0, wanted 0,
    written 0
    """
)
# words that name no variable of a function; else how often they are still assigned
LOCAL_NAMES = ceilings(
    """
    found 22, own 17, place 11, value 11, one 7, places 7, left 6, known 5, whole 4, beside 3, seen
    3, apart 2, data 2, given 2, kept 2, made 2, result 2, info 1, there 1, wanted 1, asked 0, foo
    0, held 0, here 0, item 0, moved 0, obj 0, stuff 0, temp 0, thing 0, tmp 0, told 0
    """
)
# words that name no parameter of a function; else how often they still do, all in `kernels/`
PARAMETER_NAMES = ceilings(
    """
    known 2, found 1, made 1, own 1, seen 1, asked 0, foo 0, given 0, held 0, here 0, kept 0, left
    0, moved 0, obj 0, one 0, stuff 0, temp 0, thing 0, tmp 0, told 0, wanted 0, what 0
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


def parameters_of(function):
    """Names of the parameters of one function."""
    args = function.args
    named = (*args.posonlyargs, *args.args, *args.kwonlyargs, args.vararg, args.kwarg)
    return [a.arg for a in named if a is not None]


def parameter_names(tree):
    """Parameters of functions, methods and lambdas."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.Lambda):
            yield from parameters_of(node)


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
    ("names_of", "ceilings"),
    [
        (module_names, MODULE_NAMES),
        (local_names, LOCAL_NAMES),
        (parameter_names, PARAMETER_NAMES),
    ],
)
def test_words_that_say_nothing_become_fewer(names_of, ceilings):
    counts, places = uses(names_of)
    over = [
        f"{word}: {counts[word]}, at most {ceiling}; most in {places[word].most_common(5)}"
        for word, ceiling in ceilings.items()
        if counts[word] > ceiling
    ]
    assert not over, "name what the thing is:\n" + "\n".join(over)


def documented(doc):
    """Names under ``Parameters`` of a docstring."""
    section = re.search(r"^Parameters\n-+\n(.*?)(?=^\w[^\n]*\n---|\Z)", doc or "", re.M | re.S)
    for line in (section[1] if section else "").splitlines():
        if names := re.match(r"([\w*, ]+) : |(\w+)$", line):
            yield from (name.strip(" *") for name in (names[1] or names[2]).split(","))


def test_documented_parameters_are_those_of_the_function():
    stale = []
    for path, tree in trees().items():
        for node in ast.walk(tree):
            function = node
            if isinstance(node, ast.ClassDef):
                methods = (n for n in node.body if isinstance(n, ast.FunctionDef))
                function = next((m for m in methods if m.name == "__init__"), None)
            if isinstance(function, ast.FunctionDef):
                names = parameters_of(function)
                words = documented(ast.get_docstring(node))
                stale += [f"{path}, {node.name}: {word}" for word in words if word not in names]
    assert not stale, f"documented, and no parameters: {stale}"


def test_no_file_is_long():
    lines = {
        path.relative_to(PACKAGE).as_posix(): len(path.read_text("utf-8").splitlines())
        for path in FILES
    }
    long = {p: n for p, n in lines.items() if n > MAX_LINES}
    assert not long, f"split by what they are about: {long}"
