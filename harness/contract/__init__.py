"""Contract tests for every engine: ``pytest --pyargs screwgauge.contract --engine NAME``.

Name an engine of this package or of any installed one. What it declares that it lacks, and mechanisms that it refuses
in a sentence, are skipped with its own words; all else has to pass. Needs pytest.
"""
