import copy
import pickle
import subprocess
import sys
import warnings
from concurrent.futures import ThreadPoolExecutor
from importlib.util import find_spec

import numpy as np
import pytest

import screwgauge
from support.scene import sampled

FORCES = ("generalized_force", "actuator_force")
BACKENDS = ["numpy", *(["llvm"] if find_spec("llvmlite") else [])]
N = 20


@pytest.fixture(scope="module", params=BACKENDS)
def backend(request):
    return request.param


@pytest.fixture(scope="module")
def solver(backend):
    return screwgauge.compile(sampled("3ups-upu-s", slice(0, 5 * N, 5)), FORCES, backend=backend)


def motion(name="3ups-upu-s", n=N):
    at = sampled(name, slice(0, 5 * n, 5)).motion
    return at.y.copy(), at.yd.copy(), at.ydd.copy()


def own(order="C"):
    return {"generalized_force": np.empty((N, 2), order=order), "actuator_force": np.empty((N, 4), order=order)}


def wide():
    block = np.empty((N, 9))
    return {"generalized_force": block[:, 1:3], "actuator_force": block[:, 4:8]}


@pytest.mark.parametrize("arrays", [dict, own, lambda: own("F"), wide, lambda: {"actuator_force": np.empty((N, 4))}])
def test_buffers_are_filled_in_place(solver, arrays):
    expected, given = solver(*motion()), arrays()
    out = solver.buffers(N, given)
    for _ in range(3):
        answer = solver(*motion(), out=out)
        for name in FORCES:
            assert answer[name] is out[name] is given.get(name, out[name])
            assert np.array_equal(out[name], expected[name])
            out[name][:] = np.nan


def one_row(shape):
    return np.lib.stride_tricks.as_strided(np.zeros(shape[1]), shape, (0, 8))


def sliding(shape):
    return np.lib.stride_tricks.as_strided(np.zeros(shape[0] * shape[1]), shape, (8, 8))


def odd(shape):
    return np.frombuffer(bytearray(8 * shape[0] * shape[1] + 1), offset=1).reshape(shape)


def frozen(shape):
    return np.broadcast_to(0.0, shape)


def bent(make):
    return {"actuator_force": make((N, 4))}


BLOCK = np.empty((N, 5))
#: Arrays that no buffers are made of.
REFUSED = {
    "a name that does not exist": lambda: {"actuator_forces": np.empty((N, 4))},
    "swapped names": lambda: dict(zip(FORCES, [*own().values()][::-1], strict=True)),
    "read-only": lambda: bent(frozen),
    "a wrong shape": lambda: bent(lambda shape: np.empty((N, 3))),
    "a wrong length": lambda: bent(lambda shape: np.empty((N + 1, 4))),
    "a wrong type": lambda: bent(lambda shape: np.empty(shape, dtype=np.float32)),
    "the other order of bytes": lambda: bent(
        lambda shape: np.empty(shape, dtype=">f8" if sys.byteorder == "little" else "<f8")
    ),
    "no array": lambda: bent(lambda shape: np.empty(shape).tolist()),
    "None": lambda: bent(lambda shape: None),
    "no dimension": lambda: bent(lambda shape: np.array(1.0)),
    "one number": lambda: bent(lambda shape: np.float64(1.0)),
    "a matrix": lambda: bent(lambda shape: np.asmatrix(np.empty(shape))),
    "a masked array": lambda: bent(np.ma.empty),
    "one row for all": lambda: bent(one_row),
    "rows that overlap": lambda: bent(sliding),
    "not aligned": lambda: bent(odd),
    "overlapping arrays": lambda: {"generalized_force": BLOCK[:, :2], "actuator_force": BLOCK[:, 1:]},
    "no mapping": lambda: [np.empty((N, 4))],
}


@pytest.mark.parametrize("kind", REFUSED)
def test_arrays_that_cannot_be_filled_are_refused_in_a_sentence(solver, kind):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # NumPy's, of matrices
        arrays = REFUSED[kind]()
    with pytest.raises(screwgauge.ScrewgaugeError, match="buffers"):
        solver.buffers(N, arrays)


@pytest.mark.parametrize("n", [-1, 2.0, "3", None, 10**30])
def test_a_number_of_samples_that_is_none_is_refused(solver, n):
    with pytest.raises(screwgauge.ScrewgaugeError, match="samples"):
        solver.buffers(n)


def test_nothing_but_own_buffers_of_the_right_length_is_filled(solver):
    others = screwgauge.compile(sampled("3ups-upu-s", slice(0, 50, 5)), FORCES, backend="numpy")
    good = solver.buffers(N)
    refused = (
        own(),
        {**good},
        [*good.values()],
        np.empty((N, 4)),
        others.buffers(N),
        solver.buffers(N - 1),
        copy.copy(good),
    )
    for out in refused:
        with pytest.raises(screwgauge.ScrewgaugeError, match="out: expected"):
            solver(*motion(), out=out)


def test_names_keep_their_arrays(solver):
    out = solver.buffers(N)
    answer = solver(*motion(), out=out)
    assert answer.values is out
    with pytest.raises(TypeError):
        out["actuator_force"] = np.empty((N, 4))
    with pytest.raises(TypeError):
        del out["actuator_force"]


@pytest.mark.parametrize("name", ["3ups-upu-s", "slider-crank", "arm7"])
@pytest.mark.parametrize("calls", [0, 1, 3])
def test_an_array_that_became_read_only_is_not_written(backend, name, calls):
    solver = screwgauge.compile(sampled(name, slice(0, 5 * N, 5)), ["actuator_force"], backend=backend)
    array = np.zeros((N, len(solver.components["actuator_force"])), order="F")
    out = solver.buffers(N, {"actuator_force": array})
    for _ in range(calls):
        solver(*motion(name), out=out)
    before = array.copy()
    array.setflags(write=False)
    with pytest.raises(screwgauge.ScrewgaugeError, match="read-only"):
        solver(*(0.5 * x for x in motion(name)), out=out)
    assert np.array_equal(array, before)


def bad_samples():
    y, yd, ydd = motion()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for bad in (
            None,
            np.array(1.0),
            np.asmatrix(y),
            np.ma.array(y),
            y.tolist(),
            y[:, 0],
            y.astype(complex),
            y[:1],
            "y",
        ):
            yield from ((bad, yd, ydd), (y, bad, ydd), (y, yd, bad))


@pytest.mark.parametrize("known", [False, True])
@pytest.mark.parametrize("own", [False, True])
def test_samples_of_other_kinds_are_refused_in_a_sentence(solver, known, own):
    out = solver.buffers(N) if own else None
    if known:
        solver(*motion(), out=out)
    for given in bad_samples():
        with pytest.raises(screwgauge.ScrewgaugeError, match="expected"):
            solver(*given, out=out)
    for times in (np.array(1.0), np.ma.zeros(N), [0.0] * N, np.zeros((N, 1))):
        with pytest.raises(screwgauge.ScrewgaugeError, match="t: expected"):
            solver(*motion(), t=times, out=out)


@pytest.mark.parametrize("name", ["3ups-upu-s", "slider-crank", "arm7"])
@pytest.mark.parametrize("own", [False, True])
def test_values_that_no_double_holds_are_refused_by_row(backend, name, own):
    solver = screwgauge.compile(sampled(name, slice(0, 5 * N, 5)), backend=backend)
    out = solver.buffers(N) if own else None
    good = solver(*motion(name), out=out)["actuator_force"].copy()
    for size in (1e155, 1e200, 1e308):
        y, yd, ydd = motion(name)
        yd[7, 0] = size
        for _ in range(2):
            with pytest.raises(screwgauge.ScrewgaugeError, match="row 7"):
                solver(y, yd, ydd, out=out)
    assert np.array_equal(solver(*motion(name), out=out)["actuator_force"], good)


@pytest.mark.parametrize("own", [False, True])
def test_a_program_that_cannot_answer_leaves_the_row_to_arrays(backend, own):
    solver = screwgauge.compile(sampled("arm7", slice(0, 5 * N, 5)), ["actuator_force"], backend=backend)
    out = solver.buffers(N) if own else None
    y, yd, ydd = motion("arm7")
    expected = solver(y, yd, ydd)["actuator_force"].copy()
    y[7, 0] += 2.0 * np.pi * 10**7
    for _ in range(2):
        answer = solver(y, yd, ydd, out=out)["actuator_force"]
        assert np.abs(answer - expected).max() < 1e-7 * np.abs(expected).max()


def test_a_sample_that_lies_in_its_buffer_is_read_first(backend):
    n, solver = 7000, screwgauge.compile(sampled("slider-crank", slice(0, 50, 5)), ["joint_position"], backend=backend)
    some = [np.ascontiguousarray(np.tile(x[:1], (n, 1))) for x in motion("slider-crank")]
    some[0] += np.linspace(0.0, 0.1, n)[:, None]
    expected = solver(*some)["joint_position"]
    m = expected.shape[1]
    shared = np.empty(n * m)
    shared[:n] = some[0][:, 0]
    out = solver.buffers(n, {"joint_position": shared.reshape(n, m)})
    assert np.array_equal(solver(shared[:n].reshape(n, 1), *some[1:], out=out)["joint_position"], expected)


@pytest.mark.parametrize("again", [pickle.loads, None])
def test_a_solver_is_pickled_and_copied(solver, again):
    other = copy.deepcopy(solver) if again is None else again(pickle.dumps(solver))
    answer = pickle.loads(pickle.dumps(other(*motion(), out=other.buffers(N))))
    assert np.array_equal(answer["actuator_force"], solver(*motion())["actuator_force"])
    assert other.notes == solver.notes
    with pytest.raises(screwgauge.ScrewgaugeError, match="out"):
        other(*motion(), out=solver.buffers(N))


def test_a_process_that_pickles_ends_silently(backend):
    code = (
        "import pickle, screwgauge\n"
        "scene = screwgauge.load_scene('slider-crank')\n"
        f"pickle.loads(pickle.dumps(screwgauge.compile(scene, ['actuator_force'], backend={backend!r})))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "")


@pytest.mark.parametrize("own", [False, True])
@pytest.mark.parametrize("name", ["3ups-upu-s", "slider-crank"])
def test_threads_share_a_solver(backend, name, own):
    solver = screwgauge.compile(sampled(name, slice(0, 5 * N, 5)), FORCES, backend=backend)
    given = [tuple(x * (1.0 - 0.01 * i) for x in motion(name)) for i in range(8)]
    expected = [solver(*each)["actuator_force"].copy() for each in given]

    def wrong(i):
        out = solver.buffers(N) if own else None
        return sum(not np.array_equal(solver(*given[i], out=out)["actuator_force"], expected[i]) for _ in range(50))

    with ThreadPoolExecutor(8) as pool:
        assert [*pool.map(wrong, range(8))] == [0] * 8
