"""Sentences on forces that files define but no engine includes: `armature of 2 joints, up to 6.4 of 7.4 N·m`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from screwgauge.judging.left_out import LeftOutTerm
from screwgauge.study.comparison import Comparison
from screwgauge.study.formatting import Row, join_all, number, unit_text

FIGURES = 3


def additions(results: Comparison) -> str:
    """List what each file adds to the rigid machine: ``the file also contains: armature of joint m1, ...``."""
    by_file: dict[str, list[str]] = {}
    for term in results.left_out.terms:
        by_file.setdefault(term.file or "the file", []).append(phrase(term))
    return "; ".join(f"{file} also contains: {'; '.join(phrases)}" for file, phrases in by_file.items())


def sentences(results: Comparison, *, agree: bool) -> list[str]:
    """Describe what files add to the rigid machine; any agreement of engines refers to the rigid machine only."""
    if not results.left_out.terms:
        return [*contained_sentences(results)]
    text = additions(results)
    who = join_all(results.solutions)
    if len(results.solutions) == 1:
        head = f"The results of {who} refer to the rigid machine; {text}."
    else:
        head = f"{who} agree on the rigid machine; {text}." if agree else f"{text.replace('the file', 'The file', 1)}."
    return [head, *contained_sentences(results)]


def phrase(term: LeftOutTerm) -> str:
    """Describe the kind of a force, its owners and its magnitude."""
    amount = f"up to {number(term.size, FIGURES)} of {number(term.of, FIGURES)} {unit_text(term.unit)}"
    return f"{term.kind} of {owners(term.names)}, {amount}"


def owners(names: Sequence[str]) -> str:
    """List owners: ``joint m1``, or ``2 joints and 1 tendon``."""
    if len(names) == 1:
        return names[0]
    nouns = Counter(name.partition(" ")[0] for name in names)
    plurals = {"body": "bodies"}
    return join_all(f"{n} {noun if n == 1 else plurals.get(noun, f'{noun}s')}" for noun, n in nouns.items())


def contained_sentences(results: Comparison) -> Iterator[str]:
    """Yield a sentence for each table or engine whose values include forces omitted from the description."""
    for name, kinds in results.left_out.contained.items():
        yield f"Values of {name} include {join_all(kinds)}, which the comparison leaves out."


def left_out_rows(results: Comparison) -> list[Row]:
    """Return rows with columns what, whose, size, of, unit, at, file."""
    return [
        {
            "what": term.kind,
            "whose": ", ".join(term.names),
            "size": term.size,
            "of": term.of,
            "unit": term.unit,
            "at": f"{term.component} @ {number(term.t)} s",
            "file": term.file or "of the description",
        }
        for term in results.left_out.terms
    ]
