from paper.numbering import REFERENCES, references


def test_6_numbers_are_shifted_throughout():
    (row,) = references()
    assert (row.printed.value, row.right.value) == (18, 0)
    assert ("before (22), the velocity that is computed", "19", "21") in map(tuple, REFERENCES)
    assert len({where for where, _, _ in REFERENCES}) == len(REFERENCES) == 43
