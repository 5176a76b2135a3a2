import re
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pandas as pd
from campaigns.corpus.answers import diagnosed
from campaigns.corpus.mjcf_frames import CannotError
from campaigns.corpus.pairs import SAME, MissingError, Pair, edit_named
from campaigns.corpus.sentences import Said
from campaigns.rows import rows_in_turn

#: Answers that say that the machine is the same.
ALIKE = ("SAME", "CONVENTIONS")


def pair_rows(pairs: Sequence[Pair], progress: Callable[[str, float], None]) -> pd.DataFrame:
    return pd.DataFrame(rows_in_turn([(pair.name, partial(pair_row, pair)) for pair in pairs], progress))


def pair_row(pair: Pair) -> dict[str, Any]:
    cells = {"id": pair.name, "group": pair.group, "expected": pair.expected, "planted": pair.planted}
    with TemporaryDirectory(prefix="corpus-") as name:
        folder = Path(name)
        try:
            a, b = pair.make(folder)
        except (MissingError, CannotError) as error:
            return {**cells, "answer": "SKIPPED", "right": "skipped", "rows": 0, "first": str(error), "seconds": ""}
        said, seconds = diagnosed(a, b)
        patterns = [pair.named]
        if pair.named.startswith("edit:"):
            cells["planted"], *patterns = edit_named(int(pair.named[5:]), folder)
    return {
        **cells,
        "answer": said.answer,
        "right": right(pair, said, patterns),
        "rows": said.shown,
        "first": said.first[:300],
        "seconds": f"{seconds:.2f}",
    }


def right(pair: Pair, said: Said, named: Sequence[str]) -> str:
    if said.answer in ("REFUSED", "CRASHED"):
        return said.answer.lower()
    if pair.expected == SAME:
        return "yes" if said.answer in ALIKE else "withheld" if said.answer == "PARTLY" else "no"
    if said.answer == "SAME":
        return "false SAME"
    if said.answer == "PARTLY":
        return "withheld"
    leading = re.split(r";\s", said.first)[0]
    found = all(re.search(pattern, leading, re.IGNORECASE) for pattern in named if pattern)
    return "yes" if found else "not named"
