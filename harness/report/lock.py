"""One command at a time writes into a folder: two reports in one would mix."""

from __future__ import annotations

import errno
import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from screwgauge.reference.errors import OutputError
from screwgauge.reference.files import why

#: What systems say whose folders cannot be locked, such as some network file systems.
_UNABLE = {errno.EBADF, errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL}


@contextmanager
def locked(out: Path) -> Iterator[None]:
    """Holds a folder, made if need be, as long as the context lasts; the system lets it go if the process is killed.

    A folder that was made and stayed empty goes away.

    Raises:
        OutputError: Another command holds it, or it cannot be made.
    """
    made, place = list[Path](), -1
    try:
        made = [folder for folder in (out, *out.parents) if not folder.exists()]
        out.mkdir(parents=True, exist_ok=True)
        place = os.open(out, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        fcntl.flock(place, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(place)
        what, remedy = "another command is writing into the folder", "wait for its end, or choose another with --out"
        raise OutputError(what, str(out), remedy) from None
    except (OSError, ValueError) as error:  # a path with a null byte
        if place < 0 or getattr(error, "errno", None) not in _UNABLE:
            what = f"the folder cannot be written ({why(error)})"
            raise OutputError(what, str(out), "choose another with --out") from error
    try:
        yield
    finally:
        os.close(place)
        with suppress(OSError):  # something is in it
            for folder in made:
                folder.rmdir()
