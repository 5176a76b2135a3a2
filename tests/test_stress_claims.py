"""Rows of `claims/stress.toml`."""

import re
from functools import cache
from typing import Any

import numpy as np
import pytest

from support.claims import table
from support.stress import CASES, OK, Finding, climb

CLAIMS = table("stress")
FORCES = ("generalized_force", "actuator_force")
EVERY = ("ok", "degraded", "refused", "silently-wrong")


@cache
def rung(case: str, severity: float, full: bool) -> dict[tuple[str, str], Finding]:
    return {(row.engine, row.quantity): row for row in climb(CASES[case], severity, quick=not full)}


def rungs(claim: dict[str, Any]) -> list[dict[tuple[str, str], Finding]]:
    return [rung(claim["case"], at, claim.get("full", False)) for at in claim["at"]]


@pytest.mark.slow
@pytest.mark.parametrize("claim", CLAIMS["claims"], ids=lambda claim: f"{claim['case']}: {claim['about']}")
def test_rows_are_as_claimed(claim: dict[str, Any]) -> None:
    engine, quantity = (re.compile(claim.get(name, ".*")) for name in ("engine", "quantity"))
    for found in rungs(claim):
        meant = {key: row for key, row in found.items() if engine.fullmatch(key[0]) and quantity.fullmatch(key[1])}
        assert meant
        for row in meant.values():
            assert row.verdict in claim.get("verdict", EVERY), row
            assert claim.get("reason", "") in row.reason, row
            assert row.reason or row.verdict == OK or not claim.get("warned"), row
            assert not row.error > claim.get("forces", np.inf) or row.quantity not in FORCES, row
            if "error" in claim:
                assert claim["error"][0] <= row.error <= claim["error"][1], row
            assert not row.condition <= claim.get("condition", -np.inf), row
            if "admitted" in claim:
                assert row.tolerance < claim["admitted"] * row.error, row
            if "over" in claim:
                assert row.error > claim["times"] * found[tuple(claim["over"])].error


@pytest.mark.slow
@pytest.mark.parametrize("claim", CLAIMS["slopes"], ids=lambda claim: f"{claim['case']}: {claim['about']}")
def test_errors_follow_the_severity(claim: dict[str, Any]) -> None:
    for engine in claim["engine"]:
        errors = [found[engine, claim["quantity"]].error for found in rungs(claim)]
        slope = np.polyfit(np.log(claim["at"]), np.log(errors), 1)[0]
        assert slope == pytest.approx(claim["slope"], abs=claim["off"]), engine
