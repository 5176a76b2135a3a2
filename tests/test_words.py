"""Words of a diagnosis: each kind of fact, cause and reason has its sentence, as ``told.txt`` keeps them."""

from golden import told

from screwgauge.diagnosis.answer import SLIPS, WORDS
from screwgauge.diagnosis.properties import PROPERTIES
from screwgauge.diagnosis.words import EVENTS, Speaker

#: Words of ", and 12 more causes", and what changes are of and no facts.
ROOM, CHANGES = 4, {"pose", "centre", "seat", "first_frame", "second_frame", "medium", "body", "closure"}


def test_the_sentences_are_those_that_were_kept():
    assert told.FILE.read_text(encoding="utf-8").splitlines() == [*told.lines()]


def test_each_property_event_and_slip_has_a_sentence_that_is_kept():
    whats = {fact.what for fact in told.FACTS.values()}
    assert {*PROPERTIES, *EVENTS} - CHANGES <= whats
    assert {reason.slip for reason in told.REASONS} == {*SLIPS}


def test_a_brief_sentence_fits_into_a_headline():
    brief = Speaker(told.MACHINE, brief=True)
    for cause in told.CAUSES.values():
        assert len(brief.cause(cause).split()) + ROOM <= WORDS
    for fact in told.FACTS.values():
        assert len(brief.sentence(fact).split()) + ROOM <= WORDS
