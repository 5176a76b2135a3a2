import pytest
from campaigns.corpus.edit_rows import MULTIPLE, SINGLE, multiple_edits, single_edits
from campaigns.corpus.pair_rows import pair_rows
from campaigns.corpus.pairs import pairs
from campaigns.corpus_pages import PAIRS, SEVERAL, SINGLES, pairs_passed, several_passed, singles_passed

pytestmark = pytest.mark.campaign


def test_pairs_of_the_corpus_have_the_answer_that_is_known(campaign):
    some = pairs()[: campaign.count]
    table = campaign.carry_out(PAIRS, "diagnosis/pairs", lambda progress: pair_rows(some, progress))
    assert pairs_passed(table), table[table["right"] != "yes"].to_string()


def test_changes_of_the_corpus_are_named_with_magnitude_and_sign(campaign):
    numbers = range(campaign.count or SINGLE)
    table = campaign.carry_out(SINGLES, "diagnosis/singles", lambda progress: single_edits(numbers, progress))
    assert singles_passed(table)


def test_the_largest_of_several_changes_of_the_corpus_leads(campaign):
    numbers = range(campaign.count or MULTIPLE)
    table = campaign.carry_out(SEVERAL, "diagnosis/several", lambda progress: multiple_edits(numbers, progress))
    assert several_passed(table)
