import pytest

import screwgauge

#: Operations of the forces of actuators, at most.
FORCES = {
    "3ups-upu-s": 1180,
    "five-bar": 300,
    "bennett": 570,
    "slider-crank": 150,
    "stewart": 7990,
    "3-rrr": 1070,
    "delta": 9200,
    "3-rps": 2520,
}
#: Of all quantities, at most.
ALL = {"3ups-upu-s": 2640, "stewart": 10700}


def operations(name: str, quantities: tuple[str, ...] | None) -> int:
    solver = screwgauge.compile(screwgauge.load_scene(name), quantities=quantities, backend="numpy")
    return len(solver.first.traced.program.code)


@pytest.mark.parametrize("name", FORCES)
def test_programs_of_forces_take_no_more_operations(name):
    assert operations(name, ("actuator_force",)) <= FORCES[name]


@pytest.mark.parametrize("name", ALL)
def test_programs_of_all_quantities_take_no_more_operations(name):
    assert operations(name, None) <= ALL[name]
