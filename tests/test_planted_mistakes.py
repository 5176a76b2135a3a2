import ast
from collections import Counter

import pytest
from planted import FILES, mistakes


@pytest.mark.parametrize("mistake", mistakes(), ids=lambda mistake: f"{mistake.file.stem}-{mistake.about}")
def test_a_mistake_can_be_planted(mistake):
    assert ast.dump(ast.parse(mistake.mutant.source())) != ast.dump(ast.parse(mistake.file.read_bytes()))


def test_most_are_in_what_computes_and_some_in_what_reads():
    rooms = Counter(mistake.room == FILES for mistake in mistakes())
    assert rooms == {False: 48, True: 12}
