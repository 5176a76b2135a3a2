"""The wrists of `claims/readings.toml` whose couplings are solved for other joints are the machines of their files."""

import pytest

import screwgauge
from support.claims import table, written
from support.command import main
from support.judging import agreed

TABLE = table("readings")
(WRISTS,) = (row for row in TABLE["reading"] if row["name"].startswith("driven joints lead"))


@pytest.mark.parametrize("case", WRISTS["each"][:3], ids=["a belt", "a differential", "one said twice"])
def test_the_imported_machine_is_that_of_the_file(case, tmp_path):
    file = written(WRISTS | case, TABLE["texts"], tmp_path)
    assert main(["import", str(file), "--out", str(tmp_path / "out.toml")]) == 0
    assert screwgauge.diagnose(file, tmp_path / "out.toml").same
    agreed(screwgauge.run(screwgauge.load_scene(tmp_path / "out.scene.toml")))
