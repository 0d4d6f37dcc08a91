"""What squealstudy/THEORY.md says of the code, and what the code cites of it."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "squealstudy"
THEORY = (PACKAGE / "THEORY.md").read_text(encoding="utf-8")
NUMBERS = r"\(\d+\)(?:(?:, | and | to )\(\d+\))*"
CITATION = re.compile(rf"THEORY\.md(?:\]\([^)]*\))?\s+eq\.\s+({NUMBERS})")
STANDS = re.compile(r"^\((\d+)\) (?:stands|is tried) in (.+)\.$", re.MULTILINE)
# texts that no reader has, and sources without a name
NAMELESS = {
    "a text outside the project": r"\btheory\.md|\.\./shared/\S*\.md",
    "a paper without a name": r"(?i)\b(?:the|this|their) paper\b|\bpaper(?:,|'s| (?:eq|fig|sect))",
    "an equation without a source": r"(?<!THEORY\.md )(?<!THEORY\.md\) )\beqs?\. \(?\d",
    "a figure without a source": r"(?i)^(?!.*\b(?:19|20)\d\d\b).*\bfig(?:ures?|s?\.) \d+",
}


def texts():
    """Every file that may cite, but this one and the theory itself: (name, text)."""
    paths = [ROOT / "README.md"]
    for folder in ("squealstudy", "studies", "tests"):
        paths += (p for s in ("py", "toml", "md") for p in (ROOT / folder).rglob(f"*.{s}"))
    skipped = {Path(__file__).resolve(), PACKAGE / "THEORY.md"}
    return [
        (str(p.relative_to(ROOT)), p.read_text(encoding="utf-8"))
        for p in sorted(paths)
        if p.resolve() not in skipped
    ]


def numbers():
    """Numbers of the equations, as they stand."""
    return [int(n) for n in re.findall(r"\\tag\{(\d+)\}", THEORY)]


def test_equations_are_numbered_through():
    assert numbers() == list(range(1, len(numbers()) + 1))


def test_every_equation_says_where_it_stands():
    assert sorted(set(numbers()) - {int(m[1]) for m in STANDS.finditer(THEORY)}) == []


def test_files_of_equations_exist():
    stale = [
        f"({m[1]}) names {name}, which is not there"
        for m in STANDS.finditer(THEORY)
        for name in re.findall(r"`([^`]+)`", m[2])
        if not (PACKAGE / name).is_file()
    ]
    assert not stale, "update squealstudy/THEORY.md:\n" + "\n".join(stale)


def test_cited_equations_exist():
    known = set(numbers())
    cited = {
        (name, int(number))
        for name, text in [*texts(), ("THEORY.md", THEORY.replace("eq. (", "THEORY.md eq. ("))]
        for found in CITATION.findall(text)
        for number in re.findall(r"\d+", found)
    }
    assert len(cited) > 20  # else the pattern sees none
    assert sorted(c for c in cited if c[1] not in known) == []


def test_sources_are_listed_and_used():
    text, listed = THEORY.split("## Sources")
    entries = re.findall(r"^- \[([^\]]+)\]", listed, re.MULTILINE)
    used = {
        source.strip()
        for found in re.findall(r"\[([^\]\[`$]*\b(?:19|20)\d\d[^\]\[`$]*)\]", text)
        for source in re.sub(r" eq\. [\d, ]+", "", found).split(";")
    }
    assert sorted(used) == sorted(entries)


@pytest.mark.parametrize("what", NAMELESS)
def test_nothing_cites_what_a_reader_does_not_have(what):
    found = [
        f"{name}:{line}: {text.strip()}"
        for name, whole in texts()
        for line, text in enumerate(whole.splitlines(), start=1)
        if re.search(NAMELESS[what], text)
    ]
    assert not found, f"{what}:\n" + "\n".join(found)


@pytest.mark.parametrize(
    ("what", "text"),
    [
        ("a text outside the project", "as theory.md section 1 reads it"),
        ("a paper without a name", "The paper's uniform law"),
        ("a paper without a name", "(paper figure 4)"),
        ("an equation without a source", "the fixed Jacobian (eq. 7)"),
        ("a figure without a source", "then a bounded torque (figure 11)"),
    ],
)
def test_such_citations_are_seen(what, text):
    assert re.search(NAMELESS[what], text)
    assert not re.search(NAMELESS[what], "as THEORY.md eq. (7), figure 5 of Hughes 1976")
