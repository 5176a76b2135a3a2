import gc
import threading
from itertools import combinations

import numpy as np
import pytest

import screwgauge
from support.scene import sampled
from support.traced import Pool

FORCES = ("generalized_force", "actuator_force")


@pytest.fixture
def solver():
    return screwgauge.compile(sampled("3ups-upu-s", slice(0, 500, 5)), FORCES, backend="numpy")


def motion(n):
    at = sampled("3ups-upu-s", slice(0, 500, 5)).motion.part(slice(0, n))
    return at.y.copy(), at.yd.copy(), at.ydd.copy()


def arrays(answer):
    return [*answer.values.values(), *answer.estimate.values()]


def place(array):
    return array.__array_interface__["data"][0]


@pytest.mark.parametrize("estimates", [False, True])
def test_answers_that_are_kept_share_no_memory(solver, estimates):
    answers = [solver(*motion(n), estimates=estimates) for n in (100, 100, 40, 100, 40)]
    before = [[array.copy() for array in arrays(answer)] for answer in answers]
    again = [solver(*(-x for x in motion(100)), estimates=estimates) for _ in range(3)]
    everything = [array for answer in (*answers, *again) for array in arrays(answer)]
    assert not any(np.shares_memory(a, b) for a, b in combinations(everything, 2))
    for answer, copies in zip(answers, before, strict=True):
        assert all(map(np.array_equal, arrays(answer), copies))


def test_memory_is_lent_again_when_an_answer_is_gone(solver):
    answer = solver(*motion(100))
    first = place(answer["generalized_force"])
    del answer
    assert place(solver(*motion(100))["generalized_force"]) == first


#: Ways to hold on to a part of an array without the array.
HOLDS = {
    "view": lambda x: x[3:5],
    "view of a view": lambda x: x.T[1:][..., ::2],
    "reshaped": lambda x: x[:, 0].reshape(2, -1),
    "other class": lambda x: x.view(np.recarray),
    "other type": lambda x: x.view(np.int64),
    "one number's array": lambda x: x[5:6, 0],
    "buffer": lambda x: memoryview(x[:, 0]),
    "array of a buffer": lambda x: np.asarray(memoryview(x[:, 0])),
    "transposed copy of none": lambda x: np.asarray(x, order="K"),
    "iterator": lambda x: x.flat,
    "capsule": lambda x: np.from_dlpack(x),
}


@pytest.mark.parametrize("how", HOLDS)
def test_whatever_shows_a_part_keeps_the_whole(solver, how):
    held = HOLDS[how](solver(*motion(100))["actuator_force"])
    before = np.array(held)
    gc.collect()
    for _ in range(4):
        assert not (solver(*(-x for x in motion(100)))["actuator_force"] == 0.0).all()
        solver(*(0.0 * x for x in motion(100)))
    assert np.array_equal(np.array(held), before)


def test_the_answer_keeps_its_memory_without_the_solver(solver):
    answer = solver(*motion(100))
    before = answer["actuator_force"].copy()
    del solver
    gc.collect()
    assert np.array_equal(answer["actuator_force"], before)


def test_buffers_of_the_caller_share_no_memory_with_answers(solver):
    out = solver.buffers(100)
    answer = solver(*motion(100), out=out)
    other = solver(*motion(100))
    assert not any(np.shares_memory(a, b) for a in arrays(answer) for b in arrays(other))


def test_a_pool_keeps_no_more_than_its_share():
    one = 8 * 10 * 5
    pool = Pool(kept=3 * one)
    lent = [pool.lend(pool.take(10, 5)) for _ in range(10)]
    assert len({place(x) for x in lent}) == 10
    del lent
    assert len(pool.free) == 3
    pool.lend(pool.take(20, 5))
    assert not any(block.array.shape == (10, 5) for block in pool.free)
    small = Pool(kept=one - 1)
    small.lend(small.take(10, 5))
    assert not small.free


def test_blocks_of_another_shape_are_not_taken_back():
    pool = Pool()
    old = pool.lend(pool.take(10, 5))
    new = pool.lend(pool.take(10, 6))
    del old
    assert not pool.free
    assert new.shape == (10, 6)


def test_blocks_may_come_back_from_other_threads():
    pool, errors = Pool(), list[str]()

    def borrow(mark):
        for _ in range(300):
            block = pool.take(7, 5)
            block.array[:] = mark
            view = pool.lend(block)[2:, 1:]
            if not (view == mark).all():
                errors.append("overwritten")

    threads = [threading.Thread(target=borrow, args=(float(i),)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not errors
