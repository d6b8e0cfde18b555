"""The swarm on functions of Python."""

import numpy as np
import pytest

import scarab_ident as si


def rosenbrock(x):
    return float(np.sum(100.0 * (x[1:] - x[:-1] ** 2) ** 2 + (1.0 - x[:-1]) ** 2))


def test_the_minimum_is_found():
    found = si.beetle_swarm(rosenbrock, [(-5.0, 5.0)] * 4, evaluations=20_000)
    assert found.value < 1e-6 and np.allclose(found.x, 1.0, atol=1e-2)
    assert found.evaluations == 20_000 and found.value == rosenbrock(found.x)


def test_the_same_seed_gives_the_same_result_and_a_goal_ends_the_search():
    bounds = [(-1.0, 3.0), (0.0, 0.5)]
    sphere = lambda x: float(x @ x)
    one, two = (si.beetle_swarm(sphere, bounds, seed=5, goal=1e-8) for _ in range(2))
    assert np.array_equal(one.x, two.x) and one.evaluations < 20_000 and one.value <= 1e-8


def test_every_position_is_inside_the_box_and_an_impossible_one_is_dropped():
    seen = []

    def objective(x):
        seen.append(x)
        return float("nan") if x[0] < 0.5 else float(x @ x)

    found = si.beetle_swarm(objective, [(0.0, 1.0), (-2.0, -1.0)], evaluations=2000)
    seen = np.array(seen)
    assert (seen.min(axis=0) >= [0.0, -2.0]).all() and (seen.max(axis=0) <= [1.0, -1.0]).all()
    assert np.allclose(found.x, [0.5, -1.0], atol=1e-3)


def test_nested_searches_end_with_an_error_not_a_crash():
    def search(x):
        return si.beetle_swarm(search, np.array([[0.0, 1.0]]), evaluations=20).value

    with pytest.raises(si.InputError, match="nested"):
        search(None)


@pytest.mark.parametrize(
    ("bounds", "words"),
    [
        ([], "empty"),
        ([(0.0, 1.0)] * 65, "at most 64"),
        ([(0.0, 1.0), (2.0, 1.0)], r"bounds\[1\] is \(2.0, 1.0\)"),
        ([(0.0, float("inf"))], "finite"),
    ],
)
def test_a_wrong_box_is_refused(bounds, words):
    with pytest.raises(si.InputError, match=words):
        si.beetle_swarm(lambda x: 0.0, bounds)


def test_an_exception_of_the_objective_ends_the_search():
    def objective(x):
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        si.beetle_swarm(objective, [(0.0, 1.0)])
    with pytest.raises(TypeError):
        si.beetle_swarm(lambda x: "text", [(0.0, 1.0)])
    with pytest.raises(si.InputError, match="at least 1"):
        si.beetle_swarm(lambda x: 0.0, [(0.0, 1.0)], evaluations=0)
    with pytest.raises(si.InputError, match="not finite at any"):
        si.beetle_swarm(lambda x: float("nan"), [(0.0, 1.0)], evaluations=100)
