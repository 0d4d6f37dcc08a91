"""Runs that go on from files of an earlier one, which anybody may have written."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from squealstudy.engine.chunk_rows import unforeseen
from squealstudy.engine.store import Store
from squealstudy.errors import ContradictionError, SquealstudyError
from squealstudy.mechanics.failures import FAILURES


@contextmanager
def reading_earlier_files(store: Store) -> Iterator[None]:
    """Raise ContradictionError for what nobody foresaw where files were there at the beginning.

    Types and lengths are checked as rows are read, but not every value of them.
    """
    earlier = bool(store.journal.entries)
    try:
        yield
    except SquealstudyError:
        raise
    except FAILURES as error:
        if not earlier:
            raise
        raise ContradictionError(
            f"{store.directory}: what is finished there does not fit together "
            f"({unforeseen(error)[1]}): its files are not as a run of this version writes them, or "
            "this is a mistake of ours; --fresh makes all anew. SQUEALSTUDY_DEBUG=1 shows where"
        ) from error
