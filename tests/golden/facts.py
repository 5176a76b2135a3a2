"""Golden facts: numbers with what they may be off by, and words; tables of them, and their comparison."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).parent / "tables"
WORDS, CASE = "words", "# "
#: Numbers within words: those that are part of a name are letters.
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?!\w)")
#: Below it a number within words is rounding; above it it may be off by this share, or by its last digit.
ROUNDING, SHARE = 1e-9, 1e-3
#: Engines that others may resemble, and those others.
SOFT = ("tree_force_soft", "tree_force")  # which differ where equalities are soft only
MODELS, OTHERS = ("screw", "pinocchio", "pinocchio-full"), ("mujoco", "mujoco-full")
FINER = 0.1  # share of what a number may be off by that is still written


@dataclass(frozen=True, slots=True)
class Fact:
    numbers: tuple[float, ...] = ()
    off: float = 0.0
    words: str = ""

    def within(self, kept: Fact, share: float = 1.0) -> bool:
        if self.words or kept.words:
            return same_words(self.words, kept.words)
        pairs = zip(self.numbers, kept.numbers, strict=False)
        return len(self.numbers) == len(kept.numbers) and all(close(a, b, share * kept.off) for a, b in pairs)

    def __str__(self) -> str:
        if self.words:
            return f"{WORDS}\t{self.words}"
        return f"{self.off:.1e}\t{' '.join(shortest(number, self.off) for number in self.numbers)}"


#: Key -> fact; the first word of a key is the engine, if one is meant.
Facts = Mapping[str, Fact]


def close(a: float, b: float, off: float) -> bool:
    return (math.isnan(a) and math.isnan(b)) or a == b or abs(a - b) <= off


def shortest(number: float, off: float) -> str:
    if not math.isfinite(number) or not off:
        return repr(number)
    if abs(number) < FINER * off:
        return "0"
    digits = math.ceil(math.log10(max(abs(number), off) / (FINER * off)))
    return f"{number:.{max(1, min(17, digits))}g}"


def same_words(now: str, kept: str) -> bool:
    if NUMBER.sub("#", now) != NUMBER.sub("#", kept):
        return False
    return all(map(_same_number, NUMBER.findall(now), NUMBER.findall(kept)))


def _same_number(number: str, kept: str) -> bool:
    a, b = float(number), float(kept)
    mantissa, _, power = kept.partition("e")
    last = 10.0 ** (int(power or 0) - len(mantissa.partition(".")[2])) if power or "." in mantissa else 0.0
    return max(abs(a), abs(b)) < ROUNDING or abs(a - b) <= max(SHARE * abs(b), 1.001 * last)


def candidates(key: str, facts: Facts) -> list[Fact]:
    """What stands for a row of an engine that is not kept: the same row of those that others may resemble."""
    engine, _, rest = key.partition(" ")
    before = MODELS[: MODELS.index(engine)] if engine in MODELS else MODELS if engine in OTHERS else ()
    names = [key, *(f"{other} {rest}" for other in before)]
    names += [name.replace(*SOFT) for name in names]
    return [facts[name] for name in names if name != key and name in facts]


def differences(now: Facts, kept: Facts) -> list[str]:
    sentences = [f"{key} is gone, was {kept[key]}" for key in kept if key not in now]
    for key, fact in now.items():
        known = [kept[key]] if key in kept else candidates(key, kept)
        if not known:
            sentences.append(f"{key} is new: {fact}")
        elif not any(map(fact.within, known)):
            sentences.append(f"{key} is {fact}, was {known[0]}")
    return sentences


def condensed(facts: Facts) -> dict[str, Fact]:
    kept = dict[str, Fact]()
    for key, fact in facts.items():
        if not any(fact.within(known, 0.5) for known in candidates(key, kept)):
            kept[key] = fact
    return kept


def write(part: str, cases: Mapping[str, Facts]) -> Path:
    """Writes the table of a part."""
    lines = [line for case, facts in cases.items() for line in (f"{CASE}{case}", *_lines(condensed(facts)))]
    file = FOLDER / f"{part}.tsv"
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return file


def _lines(facts: Facts) -> list[str]:
    return [f"{key}\t{fact}" for key, fact in facts.items()]


def read(part: str) -> dict[str, dict[str, Fact]]:
    cases = dict[str, dict[str, Fact]]()
    for line in (FOLDER / f"{part}.tsv").read_text(encoding="utf-8").splitlines():
        if line.startswith(CASE):
            case = cases[line.removeprefix(CASE)] = {}
            continue
        key, off, value = line.split("\t")
        numbers = () if off == WORDS else tuple(map(float, value.split()))
        case[key] = Fact(words=value) if off == WORDS else Fact(numbers, float(off))
    return cases


def text(words: object) -> Fact:
    return Fact(words=" ".join(str(words).split()) or "-")
