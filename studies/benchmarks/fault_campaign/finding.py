"""What one disturbed case came to, and the table of all of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

# verdicts that are as they should be
GOOD = ("equal", "message", "ok")
# and what may be wrong
BAD = ("silent", "differs", "traceback", "internal error", "alive", "leftover", "hang", "crash")
LONGEST = 400  # characters of a text that are shown


@dataclass(frozen=True)
class Finding:
    """One case of the campaign.

    Attributes
    ----------
    part : str
        ``kills``, ``damage``, ``environment``, ``study files``, ``matrix files``.
    number : int
        Of the case within its part: with the seed it can be made again.
    done : str
        What was done, in words.
    verdict : str
        One of GOOD or BAD. ``equal``: tables equal to an undisturbed run's; ``message``: one
        sentence that says what is wrong; ``ok``: accepted, and rightly so.
    text : str
        What was said, or what differs.
    """

    part: str
    number: int
    done: str
    verdict: str
    text: str = ""

    @property
    def good(self) -> bool:
        """Whether this is as it should be."""
        return self.verdict in GOOD

    def __str__(self) -> str:
        """On one line."""
        text = " ".join(self.text.split())
        if len(text) > LONGEST:  # a traceback at the beginning, what came of it at the end
            text = f"{text[: LONGEST // 2]} ... {text[-LONGEST // 2 :]}"
        return f"{self.part} {self.number}: {self.done}: {self.verdict}. {text}"


def table(findings: Iterable[Finding]) -> str:
    """How many cases of each part came to what."""
    found = list(findings)
    parts = list(dict.fromkeys(f.part for f in found))
    verdicts = [v for v in (*GOOD, *BAD) if any(f.verdict == v for f in found)]
    counts = Counter((f.part, f.verdict) for f in found)
    width = max([len(part) for part in parts], default=0)
    lines = [" " * width + "  cases" + "".join(f"{v:>16}" for v in verdicts)]
    for part in parts:
        row = "".join(f"{counts[part, v]:>16}" for v in verdicts)
        lines.append(f"{part:<{width}}{sum(f.part == part for f in found):>7}{row}")
    return "\n".join(lines)
