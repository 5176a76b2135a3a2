"""Makes the golden tables anew: ``python tests/golden/make.py [PART ...]``; their difference is the review."""

import os
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from screwgauge.processes import fix_threads


def facts(part: str, case: str) -> tuple[dict, float]:
    from time import process_time

    from golden.kept import PARTS

    start = process_time()
    return dict(PARTS[part].facts(case)), process_time() - start


def main(names: list[str]) -> None:
    from golden.facts import write
    from golden.kept import PARTS

    with tempfile.TemporaryDirectory() as cache:
        os.environ["SCREWGAUGE_CACHE"] = cache  # truths are computed anew
        with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
            for name in names or PARTS:
                cases = [*PARTS[name].cases()]
                made = [*pool.map(facts, [name] * len(cases), cases)]
                file = write(name, {case: facts for case, (facts, _) in zip(cases, made, strict=True)})
                seconds = [spent for _, spent in made]
                quick = [s for i, s in enumerate(seconds) if PARTS[name].quick(i, cases[i])]
                print(
                    f"{name}: {len(cases)} cases, {file.stat().st_size / 1000:.0f} kB, {sum(seconds):.1f} s, "
                    f"{sum(quick):.1f} s of them in the fast loop"
                )


if __name__ == "__main__":
    fix_threads()  # of the processes that this starts, too
    main(sys.argv[1:])
