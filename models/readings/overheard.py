"""What libraries written in C++ print on standard error, as lines: parsers of URDF say there why they fail."""

from __future__ import annotations

import os
import re
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def overheard() -> Iterator[list[str]]:
    """Errors printed inside, known after it; nothing that is printed reaches the terminal."""
    said: list[str] = []
    sys.stderr.flush()
    kept = os.dup(2)
    with tempfile.TemporaryFile() as file:
        os.dup2(file.fileno(), 2)
        try:
            yield said
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            file.seek(0)
            lines = file.read().decode(errors="replace").splitlines()
            found = (re.fullmatch(r"Error:\s+(.+)", line) for line in lines)
            said += dict.fromkeys(match[1].strip() for match in found if match)
