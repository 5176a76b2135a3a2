"""Contract tests for every engine: ``pytest --pyargs screwgauge.contract --engine NAME``.

NAME is an engine of this package or of any installed package. Tests are skipped, with the engine's own reason, if they
need something that the engine lists in `lacks` or use a mechanism that it refuses with an error message; all other
tests must pass. The tests need pytest.
"""
