"""In every process of a disturbed run: note what it writes, or send a signal at one of the writes.

FAULT_RECORD is a file to which every write is noted. FAULT_AT is ``signal who number kind``: at
the write of that number of that kind, in any one process, the signal goes to ``parent``, to
``self`` or to the ``group``.
"""

import os
import signal
import sys

EVENTS = {"open": "open", "os.rename": "rename", "os.mkdir": "mkdir", "os.remove": "remove"}
WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT
IGNORED = ("/proc", "/dev", "/sys", ".said", ".writes", ".pyc", "__pycache__", "joblib_memmapping")

os.environ.setdefault("FAULT_PARENT", str(os.getpid()))
record, at = os.environ.get("FAULT_RECORD"), os.environ.get("FAULT_AT")
after = False


def _written(event: str, arguments: tuple) -> str:
    """The event and the path that it writes, from the results or the cache on; empty if none."""
    if event not in EVENTS or (event == "open" and not (arguments[2] or 0) & WRITES):
        return ""
    path = arguments[1] if event == "os.rename" else arguments[0]
    if not isinstance(path, str | bytes | os.PathLike):
        return ""
    path = os.fsdecode(path)
    if any(word in path for word in IGNORED) or not os.path.isabs(path):
        return ""
    parts = path.split(os.sep)
    for k, part in enumerate(parts):
        if part.startswith(("results", "reference", "cache")):
            return f"{EVENTS[event]} {'/'.join(parts[k + 1 :])}"
    return ""


def _strike() -> None:
    number, who = getattr(signal, at.split()[0]), at.split()[1]
    parent = int(os.environ["FAULT_PARENT"])
    try:
        if who == "group":
            os.killpg(parent, number)
        else:
            os.kill(os.getpid() if who == "self" else parent, number)
    except ProcessLookupError:
        pass


if record:

    def _note(event: str, arguments: tuple) -> None:
        if line := _written(event, arguments):
            with open(record, "a", encoding="utf-8") as file:
                file.write(line + "\n")

    sys.addaudithook(_note)

elif at:
    sys.path.insert(0, os.path.dirname(os.path.dirname(__file__)))
    import re

    IDS = re.compile(os.environ["FAULT_IDS"])
    _, _, wanted, kind = at.split(" ", 3)
    seen = 0

    def _watch(event: str, arguments: tuple) -> None:
        global seen
        if (line := _written(event, arguments)) and IDS.sub("*", line) == kind:
            seen += 1
            if seen == int(wanted):
                _strike()

    sys.addaudithook(_watch)
