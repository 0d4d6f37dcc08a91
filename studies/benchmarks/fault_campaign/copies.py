"""A judgement in a copy of this process, which may hang or be ended by what it reads."""

from __future__ import annotations

import os
import resource
import signal
import traceback
from collections.abc import Callable

Judged = tuple[str, str]  # a verdict, and what was said


def in_a_copy(judge: Callable[[], Judged], patience_s: int, memory: int) -> Judged:
    """What `judge` says within so many seconds and bytes; ``hang``, ``crash`` or ``traceback``."""
    reading, writing = os.pipe()
    pid = os.fork()
    if not pid:
        os.close(reading)
        signal.alarm(patience_s)
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
        try:
            verdict, text = judge()
        except BaseException as error:  # whatever it is, the campaign goes on
            verdict, text = "traceback", f"{error!r} {traceback.format_exc()[-300:]}"
        with os.fdopen(writing, "w", errors="replace") as pipe:
            pipe.write(f"{verdict}\n{text}")
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading, errors="replace") as pipe:
        verdict, _, text = pipe.read().partition("\n")
    _, status = os.waitpid(pid, 0)
    if verdict:
        return verdict, text
    ended = os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0
    return ("hang", "") if ended == signal.SIGALRM else ("crash", f"signal {ended}")
