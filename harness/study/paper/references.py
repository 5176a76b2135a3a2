"""Erratum 6: every cross-reference of the paper to an equation, and the equation that is meant.

The list was made by reading; what is counted is this list. A reference that could be meant as printed counts as right.
"""

from __future__ import annotations

from screwgauge.study.paper.errata import Erratum, erratum

#: (where, printed, meant); each entry is one mention of an equation in the running text.
REFERENCES: tuple[tuple[str, str, str], ...] = (
    ("before (2)", "1", "1"),
    ("before (4)", "3", "3"),
    ("after (9)", "9", "9"),
    ("before (13)", "8", "8"),
    ("after (17), screw matrix of a chain", "16", "16"),
    ("before (18)", "5", "5"),
    ("before (21)", "15", "15"),
    ("before (22), the velocity that is computed", "19", "21"),
    ("before (24), the unit screws", "18", "18"),
    ("before (25)", "15", "15"),
    ("before (26), what is multiplied", "23", "25"),
    ("after (26), the inverse velocity", "24", "26"),
    ("before (27), rates at the start", "24", "26"),
    ("before (27), data to be updated", "24", "24"),
    ("before (29), what is differentiated", "26", "28"),
    ("before (33), what is substituted", "26", "29"),
    ("before (33), into what", "28", "30"),
    ("before (34), what is substituted", "26", "29"),
    ("before (34), into what", "31", "31"),
    ("before (37)", "33-36", "33-36"),
    ("before (38a)", "37", "37"),
    ("after (38b)", "38a", "38a"),
    ("before (40), what is substituted", "38b", "38b"),
    ("before (40), into what", "39", "39"),
    ("before (41), what is expanded", "35", "40"),
    ("before (44), what is simplified", "43", "43"),
    ("before (44), what becomes a matrix product", "43", "43"),
    ("after (48), the unit screws", "45", "45"),
    ("after (48), the acceleration", "46", "44"),
    ("after (51), the symbols", "51", "51"),
    ("after (51), the acceleration", "50", "50"),
    ("after (51), the angular velocity", "24", "26"),
    ("after (52), the rotation", "22", "24"),
    ("before (57), what is put together", "53-56", "53-56"),
    ("before (57), the basis", "47", "51"),
    ("after (57)", "57", "57"),
    ("before (58), the equations counted", "37-39", "53-55"),
    ("before (58), the wrenches", "45", "58"),
    ("section 6.1, angular velocities", "24", "26"),
    ("section 6.1, postures and positions", "22", "24"),
    ("section 6.1, accelerations", "44", "44"),
    ("section 6.1, accelerations of points", "50", "50"),
    ("section 6.2, driving forces", "56", "58"),
)


def shifted_references() -> Erratum:
    """How many of the references name another equation than they mean."""
    wrong = sum(printed != meant for _, printed, meant in REFERENCES)
    return erratum(
        6,
        "throughout",
        f"wrong ones of {len(REFERENCES)} references",
        ("references as printed, such as (22) for (24)", "the equation that is meant"),
        (wrong, 0),
        "count",
        kind="N",
    )
