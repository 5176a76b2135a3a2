"""The verdict of a run: a one-sentence headline, remarks, and the first difference."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from screwgauge.judging.allowance import NARROW, WITHIN
from screwgauge.quantities import FLOAT64, number_type
from screwgauge.reference.errors import first_few
from screwgauge.report.blocks import Banner, Status
from screwgauge.report.left_out import sentences
from screwgauge.report.reviewed import sentences as sentences_of
from screwgauge.study.comparison import Comparison
from screwgauge.study.formatting import Row, digits_text, is_empty, join_all, number, rows, size, unit_text, words
from screwgauge.study.methods import DOUBTS
from screwgauge.study.outcome import Outcome

#: Remarks on quantities that no user requests; their digits never represent the digits of a run.
OPEN_TREE = {
    "tree_force": "tree_force only checks the models: joint forces with the loops cut open, without loads.",
    "tree_force_soft": (
        "tree_force_soft only checks the models: joint forces with the loops cut open, which MuJoCo closes with "
        "springs so stiff that rounding of the pose costs digits."
    ),
}


def compared_pairs(results: Comparison) -> list[Row]:
    """Return the rows of pairs whose engines both ran, with the name of the pair."""
    return [{**row, "pair": f"{row['a']} - {row['b']}"} for row in rows(results.compared)]


def first_difference(results: Comparison) -> Row | None:
    """Return the first row out of tolerance as quantity, component, a, b, size (scaled error); None if all agree."""
    keys = {"quantity": "quantity", "component": "worst_component", "a": "a", "b": "b", "size": "max_scaled"}
    bad = (row for row in compared_pairs(results) if not row["ok"])
    return next(({key: row[column] for key, column in keys.items()} for row in bad), None)


def verdict(results: Comparison) -> Banner:
    """Join the headline and the remarks."""
    headline, remarks = conclusion(results)
    return Banner(" ".join([headline.text, *remarks]), headline.word, headline.status)


def conclusion(results: Comparison) -> tuple[Banner, list[str]]:
    """Return the headline of a run, one sentence on the most serious finding, and further remarks."""
    sentences, word, status = _conclusion(results)
    return Banner(sentences[0], word, status), sentences[1:]


def _conclusion(results: Comparison) -> tuple[list[str], str, Status]:
    outcome = results.outcome
    news = [text for each in results.outcomes if each in _SENTENCES for text in _SENTENCES[each](results)]
    left = sentences(results, agree=outcome in ("agree", "judged", "rigid"))
    if not results.ok:
        left += [_leave(results.left_out.inertia)] if "rigid" in results.outcomes else []
        rest = [] if {"differ", "faulted"} & {*results.outcomes} else _agreement(results)
        return [*news, *left, *rest], WORDS[outcome], "failed" if outcome == "failed" else "differ"
    agreement, word = _agreement(results), WORDS[outcome]
    doubts = results.reservations
    if doubts or left:
        more = [f"All {len(doubts)} reservations are listed below."] if len(doubts) > DOUBTS else []
        return [*left, *doubts[:DOUBTS], *more, *agreement], f"{word}, but", "note"
    return agreement, word, "agree"


#: Outcome of a run -> word.
WORDS: dict[Outcome, str] = {
    "agree": "✓ AGREE",
    "judged": "✓ WITHIN TOLERANCE",
    "rigid": "✗ INERTIA LEFT OUT",
    "unlike": "✗ MODELS DIFFER",
    "undecided": "✗ NOT DECIDED",
    "partly": "✗ PARTLY",
    "unjudged": "✗ NOT JUDGED",
    "nothing": "✗ NOTHING COMPARED",
    "faulted": "✗ OUT OF TOLERANCE",
    "differ": "✗ DIFFER",
    "failed": "✗ FAILED",
}


def _failures(results: Comparison) -> list[str]:
    failed = "; ".join(f"{name}: {f.reason.rstrip('.')}" for name, f in results.failures.items())
    head = "An engine failed" if len(results.failures) == 1 else f"{len(results.failures)} engines failed"
    return [f"{head}: {failed}."]


def _omissions(results: Comparison) -> list[str]:
    """List what was requested but not compared, merging equal reasons."""
    engines_by_sentence: dict[str, list[str]] = {}
    for one in results.refusals:
        engines_by_sentence.setdefault(one.sentence, []).append(one.engine)
    lost = [f"{join_all(names)}: {sentence}." for sentence, names in engines_by_sentence.items()]
    return [
        *lost,
        *(f"No two engines compute the same components of {name}, so it is not compared." for name in results.apart),
    ]


def _unjudged_engines(results: Comparison) -> list[str]:
    text = f"Not judged: {join_all(results.unjudged)}; no equation of mechanics can be tested on the returned values."
    return [text] if len(results.solutions) > 1 else []


def _report_undecided(results: Comparison) -> list[str]:
    """Report undecided samples, with the pair or residual that has the most of them as an example."""
    found = [row for row in [*compared_pairs(results), *rows(results.judge)] if row["undecided"]]
    row = max(found, key=lambda row: row["undecided"])
    count = f"{results.undecided} of {len(results.times)} samples"
    if "a" not in row:
        return [f"Not decided at {count}: the {words(row['residual'])} residual of {row['engine']} is {row['reason']}."]
    first = f"{row['a']} and {row['b']} differ in {row['quantity']}{_place(row)} by {_amount(row)}{_reason(row)}"
    return [f"Not decided at {count}: {first}."]


def _difference(results: Comparison) -> list[str]:
    """Report the first difference."""
    bad, pairs = rows(results.differences), compared_pairs(results)
    row = bad[0]
    more = [f"{len(bad)} of {len(pairs)} comparisons are out of tolerance."] if len(bad) > 1 else []
    if is_empty(row["max_scaled"]):
        reason = str(row.get("reason") or "not a number").rstrip(".")
        if not row["b"]:  # an engine stopped, and ran alone
            return [f"{reason}.", *more]
        where = f"{row['quantity']}" + (f" at {row['worst_component']}" if row["worst_component"] else "")
        return [f"{row['a']} and {row['b']} cannot be compared: first in {where} ({reason}).", *more]
    where = f"first in {row['quantity']} at {row['worst_component']}" if row["worst_component"] else row["quantity"]
    at = f" at t = {number(row['worst_t'])} s"
    differ = f"{row['a']} and {row['b']} differ: {where}, by {_amount(row)}{at}{_reason(row)}."
    known, unknown = (_report_faults(results, explained=explained) for explained in (True, False))
    cause = " ".join([differ, *_model_differences(results, row["a"], row["b"])])  # a headline has one sentence
    return [*known, cause, *unknown, *more, *results.known]


def _report_faults(results: Comparison, *, explained: bool) -> Iterator[str]:
    """Yield sentences, brief enough for a headline, on faults in tables that are out of tolerance."""
    for name, review in results.reviews.items():
        if review.explained == explained and not all(column.ok for column in review.columns):
            yield f"{name}: {' '.join(sentences_of(review))}"


def _place(row: Row) -> str:
    return f" at {row['worst_component']}, t = {number(row['worst_t'])} s," if row["worst_component"] else ""


def _model_differences(results: Comparison, *engines: str) -> list[str]:
    """Report differences between the engines' model files and the description."""
    differences = dict.fromkeys(each.sentence for name in engines for each in results.solutions[name].otherwise)
    return [f"The models also differ: {first_few(differences, DOUBTS, '; ')}."] if differences else []


def _mismatch_warnings(results: Comparison) -> list[str]:
    """Report differences in model files that the scene does not allow, unless they have been reported already."""
    if {"differ", "faulted"} & {*results.outcomes}:
        return []
    differ = f"Model files differ from the description: {first_few(results.mismatches.values(), DOUBTS, '; ')}."
    return [differ, _leave(results.mismatches)]


def _leave(keys: Iterable[str]) -> str:
    """State how a scene can allow given differences."""
    entries = ", ".join(f'"{key}"' for key in keys)
    return f"If this is intended, allow it in the scene: allow = [{entries}]."


def _fault(results: Comparison) -> list[str]:
    """Report the first residual out of tolerance, unless a difference in models already explains it."""
    row = rows(results.faults)[0]
    at = f" at {row['worst_component']}, t = {number(row['worst_t'])} s" if row.get("worst_component") else ""
    sentence = f"The judge faults {row['engine']}: {words(row['residual'])} residual {_amount(row)}{at}{_reason(row)}."
    return (
        [sentence] if len(results.differences) else [" ".join([sentence, *_model_differences(results, row["engine"])])]
    )


#: Outcome -> function that returns its sentences.
_SENTENCES: dict[Outcome, Callable[[Comparison], list[str]]] = {
    "failed": _failures,
    "differ": _difference,
    "faulted": _fault,
    "unjudged": _unjudged_engines,
    "partly": _omissions,
    "undecided": _report_undecided,
    "unlike": _mismatch_warnings,
}


def _amount(row: Row) -> str:
    tolerance = number(row["tolerance"], 2)
    return f"{size(row['max_abs'])} {unit_text(row['unit'])} ({size(row['max_scaled'])} scaled, tolerance {tolerance})"


def _reason(row: Row) -> str:
    return f", {row['reason']}" if row.get("reason") else ""


def _report_alone(results: Comparison) -> Iterator[str]:
    """Yield sentences on quantities that only one engine computes."""
    for engine, names in results.alone:
        yield f"Not compared: {join_all(names)} of {engine}, which no other engine computes."


def not_unique(results: Comparison) -> Iterator[str]:
    """Count components that are not compared because their values are not unique."""
    for quantity, names in results.not_unique.items():
        n = len(results.components(quantity))
        count, others = f"{len(names)} of {n}", ", and the digits refer to the others"
        if len(names) == n:
            count, others = f"All {n}", ""
        yield f"{count} components of {quantity} have no unique value: they are not compared{others}."


def _report_integrated(pairs: list[Row]) -> list[str]:
    """Count the pairs that agree only within integration errors."""
    n = sum(row["reason"].startswith(WITHIN) for row in pairs)
    limits = "by more than their usual tolerance, but by no more than the estimated error of integration"
    return [f"{n} of them differ {limits}."] if n else []


def _fewest(agree: list[Row], simulated: bool) -> tuple[str, list[str]]:
    """Report the digits of agreement, with narrow number types last; return open-tree quantities with fewer digits."""
    narrow = [row for row in agree if row["reason"].startswith(NARROW)]
    wide = [row for row in agree if not row["reason"].startswith(NARROW)]
    text, open_tree = _of_float64(wide, simulated) if wide else ("", [])
    return "; ".join(filter(None, [text, *_of_narrow(narrow)])), open_tree


def _of_narrow(narrow: list[Row]) -> Iterator[str]:
    """Report the digits to which each method in a narrow number type agrees, and the digits that the type allows."""
    names = dict.fromkeys(name for row in narrow for name in (row["a"], row["b"]) if number_type(name) is not FLOAT64)
    for name in names:
        row = max((row for row in narrow if name in (row["a"], row["b"])), key=lambda row: row["max_scaled"])
        where = f"(fewest in {row['quantity']}, where rounding may limit them to {digits_text(row['tolerance'])})"
        yield f"{name} as {number_type(name).name} to {digits_text(row['max_scaled'])} digits or more {where}"


def _of_float64(agree: list[Row], simulated: bool) -> tuple[str, list[str]]:
    """Report the digits of agreement in float64, and return the open-tree quantities with fewer digits."""
    counted = [row for row in agree if not has_excuse(row, simulated)] or agree
    asked = [row for row in counted if row["quantity"] not in OPEN_TREE] or counted
    least = max(asked, key=lambda row: row["max_scaled"])
    errors = dict[str, float]()
    for row in counted:
        if row["max_scaled"] > least["max_scaled"]:
            errors[row["quantity"]] = max(row["max_scaled"], errors.get(row["quantity"], 0.0))
    text = f"to {digits_text(least['max_scaled'])} digits or more (fewest in {least['quantity']})"
    others = [f"{name} ({digits_text(error)})" for name, error in errors.items()]
    excused = {(row["quantity"], row["unit"]): row["reason"] for row in agree if row not in counted}
    others += [f"{name} in {unit_text(unit)} ({reason})" for (name, unit), reason in excused.items()]
    but = join_all(others)
    open_tree = [*errors] or [name for name in OPEN_TREE if name == least["quantity"]]
    return f"{text}, apart from {but}" if but else text, open_tree


def has_excuse(row: Row, simulated: bool) -> bool:
    """Return True if the row has an excuse for few digits, e.g. numbers that are zero within rounding."""
    return bool(row["ok"] and row["reason"] and not simulated and not row["reason"].startswith(NARROW))


def _agreement(results: Comparison) -> list[str]:
    engines, pairs = list(results.solutions), compared_pairs(results)
    if not engines:
        return ["No engine ran."]
    if pairs:
        untested = [*not_unique(results), *_report_alone(results), *filter(None, [results.coverage.poor])]
        agree = [row for row in pairs if row["ok"]]
        if not agree:
            return untested
        fewest, open_tree = _fewest(agree, results.scene.simulated)
        every = "the only comparison is" if len(pairs) == 1 else f"all {len(pairs)} comparisons are"
        if len(agree) < len(pairs):
            return [f"{len(agree)} of {len(pairs)} comparisons are within tolerance, {fewest}.", *untested]
        if "partly" in results.outcomes:
            return [f"What was compared is within tolerance, {fewest}.", *untested]
        remarks = [*(OPEN_TREE[each] for each in open_tree), *_report_integrated(pairs), *untested]
        return [f"{join_all(engines)} agree: {every} within tolerance, {fewest}.", *remarks]
    residuals = "its residuals are" if len(engines) == 1 else "their residuals are"
    judged = f"{residuals} within tolerance" if len(results.judge) else "nothing was judged"
    if len(engines) == 1:
        return [f"Only {engines[0]} ran, so there is nothing to compare it with; {judged}."]
    return [f"{join_all(engines)} ran, but have no quantity in common: nothing was compared; {judged}."]
