import ast
import re
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

REFERENCE = Path(__file__).parents[1] / "reference"
#: Equations with a function; eq. (1) defines a notation, eqs. (59) and (60) are a case.
FIRST, LAST = 2, 58
NAMED = re.compile(r"`([\w./]+\.py): ([\w.]+)`")
#: "eq. (8)", "eqs. (2), (18)-(20)", "(eqs. 15-27)" of a docstring.
NUMBER = r"\(?\d+\)?(?:-\(?\d+\)?)?"
CITED = re.compile(rf"\beqs?\. ({NUMBER}(?:(?:, | and ){NUMBER})*)", re.IGNORECASE)


class Row(NamedTuple):
    equations: range
    towards: int | None
    functions: list[tuple[str, str]]
    words: str


def span(text: str) -> range:
    """ "8" or "(18)-(20)"."""
    first, *last = re.findall(r"\d+", text)
    return range(int(first), int(last[0] if last else first) + 1)


def rows() -> list[Row]:
    text = (REFERENCE / "README.md").read_text(encoding="utf-8")
    found = []
    for equations, where, words in re.findall(r"^\| (\d[\d-]*) \| (.*?) \| (.*?) \|$", text, re.MULTILINE):
        step = re.match(r"step towards eq\. (\d+): ", where)
        functions = NAMED.findall(where) + NAMED.findall(words)
        found.append(Row(span(equations), int(step[1]) if step else None, functions, words))
    return found


@cache
def tree(path: str) -> ast.Module:
    return ast.parse((REFERENCE / path).read_text(encoding="utf-8"))


def docstring(path: str, name: str) -> str:
    at: ast.AST = tree(path)
    for part in name.split("."):
        (at,) = [
            node
            for node in getattr(at, "body", [])
            if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name == part
        ]
    return ast.get_docstring(at) or ""


def cited(text: str) -> set[int]:
    return {number for found in CITED.findall(text) for each in re.findall(NUMBER, found) for number in span(each)}


def test_every_equation_has_one_row_in_order():
    assert [number for row in rows() for number in row.equations] == [*range(FIRST, LAST + 1)]


@pytest.mark.parametrize("row", rows(), ids=lambda row: f"{row.equations[0]}")
def test_the_functions_of_a_row_are_there_and_name_its_equations(row):
    (path, name), *others = row.functions
    wanted = {*row.equations} if row.towards is None else {row.towards}
    assert wanted <= cited(docstring(path, name)), (path, name)
    for path, name in others:
        assert wanted & cited(docstring(path, name)), (path, name)


@pytest.mark.parametrize("row", [row for row in rows() if row.towards], ids=lambda row: f"{row.equations[0]}")
def test_a_step_leads_to_a_row_of_its_own(row):
    (there,) = [other for other in rows() if row.towards in other.equations]
    assert there.towards is None
    assert row.functions[0] in there.functions


def test_rows_say_where_the_paper_errs():
    wrong = {4, 9, 14, 22, 23, 24, 25, 27, 32, 36, *range(38, 44), 49, 51, 53, 54, 55, 56, 58}
    assert {number for row in rows() if "*Erratum*" in row.words for number in row.equations} == wrong


def test_citations_are_read_in_all_their_forms():
    assert cited("eq. (8), and eqs. (2), (18)-(20); (eqs. 53-55) and Eq. (56).") == {8, 2, 18, 19, 20, 53, 54, 55, 56}
