from typing import Any

import numpy as np

from screwgauge.judging.assembly_modes import assembly_of, other_assemblies
from screwgauge.reference.mechanism import Mechanism
from screwgauge.study.comparison import Comparison


def counts(mechanism: Mechanism) -> dict[str, int]:
    bodies, joints = len(mechanism.bodies), len(mechanism.joints)
    return {"bodies": bodies, "joints": joints, "freedoms": len(mechanism.independent), "loops": joints - bodies}


def judged(results: Comparison) -> dict[str, Any]:
    """Verdict and worst pair of a comparison.

    ``agree``, ``estimated`` (out of tolerance, but within what an engine admits), ``differ``, ``judged`` (pairs agree
    and a residual of an engine is out of tolerance), ``failed`` (an engine gave no answer).
    """
    row: dict[str, Any] = {"engines": " ".join(results.solutions), "verdict": "agree"}
    for name, solution in results.solutions.items():
        row[f"{name}_s"] = f"{sum(timing.min_s for timing in solution.timings):.3g}"
    pairs = [dict[Any, Any](pair) for pair in results.pairs.to_dict("records")]
    mechanism, solutions = results.scene.mechanism, results.solutions
    apart = other_assemblies(mechanism, results.scene.problem(()), solutions.values())
    unknown = [name for name, solution in solutions.items() if assembly_of(mechanism, solution) is None]
    row["branch"] = f"unknown for {', '.join(unknown)}" if unknown else next(iter(apart.values()), "same")
    # the tolerance of soft constraints follows their stiffness, and what is zero is told by its summands
    ranked = [
        pair
        for pair in pairs
        if not pair["ok"] or (pair["quantity"] != "tree_force_soft" and pair["max_scaled"] <= pair["tolerance"])
    ]
    if numbers := [pair for pair in ranked if np.isfinite(pair["max_scaled"])]:
        worst = max(numbers, key=lambda pair: pair["max_scaled"] / pair["tolerance"])
        estimates = (solutions[worst[side]].errors.get(worst["quantity"]) for side in "ab")
        row |= {key: f"{worst[key]:.2g}" for key in ("max_scaled", "tolerance")}
        row |= {"quantity": worst["quantity"], "pair": f"{worst['a']} - {worst['b']}"}
        row |= {"component": worst["worst_component"]}
        row |= {"estimate": f"{max((one.largest for one in estimates if one is not None), default=0.0):.2g}"}
    if beyond := [dict[Any, Any](residual) for residual in results.judge.to_dict("records") if not residual["ok"]]:
        worst = max(beyond, key=lambda residual: float(np.nan_to_num(residual["max_scaled"], nan=np.inf)))
        row |= {"judge": f"{worst['engine']} {worst['residual']} {worst['max_scaled']:.2g}", "verdict": "judged"}
    if wrong := [pair for pair in pairs if not pair["ok"]]:
        decided = [pair for pair in wrong if not pair["undecided"]]
        row |= {"reason": (decided or wrong)[0]["reason"], "verdict": "differ" if decided else "estimated"}
    if results.failures:
        reasons = (f"{name}: {failure.reason}" for name, failure in results.failures.items())
        row |= {"reason": "; ".join(reasons), "verdict": "failed"}
    return row
