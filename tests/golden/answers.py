"""Facts of what engines answer: values, what they admit of their errors, comparison and judgement."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import numpy as np
from golden.facts import ROUNDING, Fact, text

LEAST, SLACK = 1e-13, 10.0
#: Decades that estimates and conditions may be off by, as rounding of another processor moves them, and sizes that are
#: seen where rounding is left.
ESTIMATED, MEASURED = 0.1, 0.3
PROVED = 1e-30  # radii below are as small as precision made them

Row = tuple[str, Fact]


def largest(values: Any) -> dict[str, float]:
    """Unit -> largest magnitude."""
    sizes = np.nan_to_num(np.abs(values.array)).max(axis=0, initial=0.0)
    return {unit: max(s for s, u in zip(sizes, values.units, strict=True) if u == unit) for unit in values.units}


def offs(solution: Any, quantity: str, least: float = LEAST) -> dict[str, float]:
    """Unit -> what numbers of a quantity may be off by: ten times the error that the engine admits."""
    error = solution.errors.get(quantity)
    admitted = {} if error is None else error.absolute
    share = max(least, SLACK * float(np.max(error.scaled)) if error is not None else 0.0)
    sizes = largest(solution.values[quantity])
    return {unit: max(share * size, SLACK * admitted.get(unit, 0.0)) for unit, size in sizes.items()}


def by_component(solution: Any, quantity: str, least: float = LEAST) -> Iterator[Row]:
    values, off = solution.values[quantity], offs(solution, quantity, least)
    weights = np.cos(1.0 + 2.0 * np.arange(len(values.array)))
    for name, unit, column in zip(values.components, values.units, values.array.T, strict=True):
        numbers = column.min(), column.max(), math.sqrt(np.mean(column**2)), np.mean(weights * column)
        yield f"{solution.engine} {quantity} {name} [{unit}]", fact(numbers, off[unit])


def by_unit(solution: Any, quantity: str, least: float = LEAST) -> Iterator[Row]:
    values, off = solution.values[quantity], offs(solution, quantity, least)
    n, m = values.array.shape
    weights = np.cos(1.0 + 2.0 * np.arange(n)[:, None] + 3.0 * np.arange(m))
    for unit in dict.fromkeys(values.units):
        columns = [i for i, has in enumerate(values.units) if has == unit]
        some = values.array[:, columns]
        numbers = math.sqrt(np.mean(some**2)), np.mean(weights[:, columns] * some)
        yield f"{solution.engine} {quantity} [{unit}]", fact(numbers, off[unit])


def fact(numbers: Iterable[float], off: float) -> Fact:
    return Fact(tuple(map(float, numbers)), off) if math.isfinite(off) else text("no digit")


def values_of(results: Any, rows: Callable[..., Iterator[Row]], least: float = LEAST) -> Iterator[Row]:
    """All quantities of all engines."""
    for solution in results.solutions.values():
        for quantity in solution.values:
            yield from rows(solution, quantity, least)


def errors_of(solution: Any) -> Iterator[Row]:
    """Largest estimate, admitted error and radius of each quantity in turn.

    Conditions are that of the closing system, and the worst that any quantity was solved from.
    """
    name, errors = solution.engine, [*solution.errors.values()]
    proved = [error.radius for error in errors if error.radius is not None]
    errors = [error for error in errors if error.radius is None]
    met = [error.worst_condition for error in errors]
    conditions = [float(np.max(solution.condition)), *([max(met)] if met else [])]
    admitted = [size for error in errors for size in error.absolute.values()]
    sizes = {"estimates": [error.scaled for error in errors], "tolerances": admitted, "conditions": conditions}
    for what, arrays in sizes.items():
        # of MuJoCo's estimates another processor moved one by 0.11
        off = MEASURED if what != "conditions" and name.startswith("mujoco") else ESTIMATED
        if arrays:
            yield f"{name} {what}", logarithms([float(np.max(each)) for each in arrays], off)
    if proved:
        radii = [max(PROVED, float(np.max(each))) for each in proved]
        yield f"{name} radii", logarithms(radii, 0.5)


def logarithms(numbers: Any, off: float = ESTIMATED) -> Fact:
    with np.errstate(all="ignore"):
        return Fact(tuple(float(x) for x in np.log10(np.abs(numbers))), off)


def verdicts_of(results: Any) -> Iterator[Row]:
    yield "verdict", text(f"{results.exit_status}; {len(results.pairs)} pairs, {len(results.judge)} residuals")
    for kind, rows in (("pair", results.pairs), ("residual", results.judge)):
        for quantity, some in rows.groupby("quantity" if kind == "pair" else "residual"):
            bad = some[~some["ok"].astype(bool)]
            if len(bad):
                who = bad[["a", "b", "unit"] if kind == "pair" else ["engine", "unit"]].to_numpy().tolist()
                yield f"{kind} {quantity} not ok", text("; ".join(" ".join(map(str, each)) for each in who))
            off = ESTIMATED if quantity != "tree_force_soft" else MEASURED
            each = np.log10(some["tolerance"].dropna())
            yield f"{kind} {quantity} tolerances", fact([each.min(), each.max(), each.mean()], off)
    yield from facts_of(results)


def counted(results: Any) -> Iterator[Row]:
    unique = results.mobility["unique forces"]
    counts = [count for count in results.mobility.values() if not isinstance(count, dict)]
    yield "mobility", text(f"{counts}, not unique: {sum(not each for each in unique.values())}")


def facts_of(results: Any) -> Iterator[Row]:
    yield from counted(results)
    yield "not unique", text(", ".join(name for name, each in results.mobility["unique forces"].items() if not each))
    words: Mapping[str, Iterable[Any]] = {
        "warnings": results.warnings,
        "undetermined": results.undetermined,
        "refusals": [one.sentence for one in results.refusals],
        "failures": [f"{name}: {one.reason}" for name, one in results.failures.items()],
        **{f"{name} notes": one.notes for name, one in results.solutions.items() if noted(one)},
    }
    for name, sentences in words.items():
        if sentences:
            yield name, text(" | ".join(sentences))


def noted(solution: Any) -> bool:
    return solution.cost is None and all(error.radius is None for error in solution.errors.values())


def measured(table: Any, names: list[str], scaled: str, size: str) -> Iterator[Row]:
    for row in table.to_dict("records"):
        key = " ".join(str(row[name]) for name in names)
        if row[scaled] <= ROUNDING:
            yield key, text("rounding")
            continue
        yield key, sized(row[scaled], row[size])
        yield f"{key} is worst", text(str(row["worst_component"]).removesuffix(" by actuators"))


def sized(*numbers: float) -> Fact:
    return logarithms(list(map(float, numbers)), 1e-6)
