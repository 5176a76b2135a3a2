from collections.abc import Mapping

import pandas as pd
from campaigns.page import study

from screwgauge.report.blocks import Banner
from screwgauge.study.formatting import Row, group_rows, rows

YES = "yes"
#: What is wanted of the pairs: so many right, and no false verdict.
PAIRS_RIGHT = 200 / 211
#: Of single edits: the item in the first sentence with magnitude and sign; nothing else named.
NAMED, CLEAN = 0.95, 0.90
#: Of several: the largest share leads.
LED = 0.95
#: Groups that the figure of 200 of 211 is of.
FIRST = ("own", "user", "edits", "packages", "parallel")
FALSE = ("no", "false SAME", "crashed")


# --- pairs


def pairs_passed(table: pd.DataFrame) -> bool:
    asked = table[table["right"] != "skipped"]
    return bool((asked["right"] == YES).mean() >= PAIRS_RIGHT and not asked["right"].isin(FALSE).any())


def _pairs_banner(table: pd.DataFrame) -> Banner:
    asked = table[table["right"] != "skipped"]
    wrong = asked[asked["right"].isin(FALSE)]
    same = int((asked["right"] == "false SAME").sum())
    text = (
        f"{len(asked)} pairs: {int((asked['right'] == YES).sum())} right, {len(wrong)} wrong ({same} false SAME), "
        f"{len(asked) - len(wrong) - int((asked['right'] == YES).sum())} without an answer or the planted part; "
        f"{int(asked['rows'].sum())} rows in all. "
        f"{len(table) - len(asked)} left out: no package, or no way to say them differently."
    )
    return Banner.of(text, pairs_passed(table), "PASSED", "FAILED")


def _pair_groups(table: pd.DataFrame) -> list[Row]:
    def line(label: str, some: list[Row]) -> Row:
        count = {name: sum(row["right"] == name for row in some) for name in (YES, *FALSE, "skipped")}
        wrong = sum(count[name] for name in FALSE)
        return {
            "label": label,
            "pairs": len(some),
            "right": count[YES],
            "wrong": wrong,
            "open": len(some) - count[YES] - wrong - count["skipped"],
            "skipped": count["skipped"],
            "named": sum(int(row["rows"]) for row in some),
        }

    groups = [line(str(name), some) for (name,), some in group_rows(rows(table), "group").items()]
    first = [row for row in rows(table) if row["group"] in FIRST]
    return [*groups, line("own to parallel", first), line("all", rows(table))]


PAIRS = study(
    "pairs.csv",
    "Pairs of files put to a diagnosis",
    _pairs_banner,
    groups=_pair_groups,
    wrong=lambda table: [row for row in rows(table) if row["right"] not in (YES, "skipped")],
    pairs=lambda table: rows(table),
)


# --- edits


def found(row: Row) -> bool:
    return all(row[name] == YES for name in ("named", "magnitude", "sign"))


def singles_passed(table: pd.DataFrame) -> bool:
    named, clean = (sum(good) / len(table) for good in (map(found, rows(table)), table["others"] == 0))
    return named >= NAMED and clean >= CLEAN


def _figures(some: list[Row]) -> Row:
    count = {name: sum(row[name] == YES for row in some) for name in ("found", "named", "magnitude", "sign")}
    return {
        "edits": len(some),
        "detected": count["found"],
        "item": count["named"],
        "sized": sum(row["named"] == row["magnitude"] == YES for row in some),
        "way": sum(found(row) for row in some),
        "clean": sum(int(row["others"]) == 0 for row in some),
        "rows": sum(int(row["rows"]) for row in some),
    }


def _singles_banner(table: pd.DataFrame) -> Banner:
    all_ = _figures(rows(table))
    text = (
        "{edits} edits: {detected} detected, {item} named in the first sentence, {sized} with the right magnitude, "
        "{way} with the right sign or direction, too; in {clean} nothing else is named. {rows} rows in all."
    ).format(**all_)
    return Banner.of(text, singles_passed(table), "PASSED", "FAILED")


def _by(*names: str) -> object:
    def lines(table: pd.DataFrame) -> list[Row]:
        groups: Mapping[tuple[object, ...], list[Row]] = group_rows(rows(table), *names)
        return [{"label": ", ".join(map(str, label)), **_figures(some)} for label, some in groups.items()]

    return lines


SINGLES = study(
    "singles.csv",
    "Single edits put to a diagnosis",
    _singles_banner,
    scrambled=_by("scrambled"),
    kinds=_by("edit", "scrambled"),
    models=_by("model"),
    misses=lambda table: [row for row in rows(table) if not found(row) or int(row["others"])],
)


def several_passed(table: pd.DataFrame) -> bool:
    return bool((table["leads"] == YES).mean() >= LED)


def _several_banner(table: pd.DataFrame) -> Banner:
    led, every = (int((table[name] == YES).sum()) for name in ("leads", "all"))
    clean = int((table["others"] == 0).sum())
    text = (
        f"{len(table)} models with two or three edits: in {led} the one "
        f"with the largest share of the torque difference "
        f"leads the first sentence, in {every} all are named somewhere, in {clean} nothing else is."
    )
    return Banner.of(text, several_passed(table), "PASSED", "FAILED")


SEVERAL = study(
    "several.csv",
    "Several edits at once put to a diagnosis",
    _several_banner,
    misses=lambda table: [row for row in rows(table) if row["leads"] != YES or int(row["others"])],
)
