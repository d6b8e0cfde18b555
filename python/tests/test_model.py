"""Torques and regressors: against Pinocchio's numbers, and against each other."""

import json

import numpy as np
import pytest

import scarab_ident as si
from conftest import ROOT

ROBOTS = json.loads((ROOT / "host/tool/tests/data/robots.json").read_text())["robots"]


@pytest.mark.parametrize("robot", ROBOTS, ids=[robot["name"] for robot in ROBOTS])
def test_torque_is_pinocchio_s(robot, tmp_path):
    file = tmp_path / "robot.urdf"
    file.write_text(robot["urdf"])
    leg = si.Leg.from_urdf(file, robot["joints"], locked=robot["lock"], gravity=robot["gravity"])
    q, qd, qdd, torque = (
        np.array([state[key] for state in robot["states"]]) for key in ("q", "qd", "qdd", "torque")
    )
    rigid = leg.parameters("prior").reshape(-1, 14)
    rigid[:, 10:] = 0.0
    scale = max(1.0, np.abs(torque).max())
    found = leg.inverse_dynamics(q, qd, qdd, parameters=rigid.ravel())
    assert np.abs(found - torque).max() <= 1e-9 * scale
    found = leg.regressor(q, qd, qdd, inertial_only=True) @ rigid[:, :10].ravel()
    assert np.abs(found - torque).max() <= 1e-9 * scale


def test_regressor_times_parameters_is_newton_euler(states):
    leg = si.Leg.from_toml("x2-wearer-75kg")
    parameters = np.random.default_rng(3).normal(size=28)
    torque = leg.inverse_dynamics(*states, parameters=parameters)
    assert torque.shape == (400, 2)
    columns = leg.regressor(*states)
    assert columns.shape == (400, 2, 28)
    assert np.allclose(columns @ parameters, torque, rtol=0, atol=1e-11 * np.abs(torque).max())


def test_d_h_angles_differ_by_direction_and_zero():
    leg = si.Leg.from_toml("x2-wearer-75kg")
    q, qd, qdd = np.array([0.3, 0.8]), np.array([1.0, -2.0]), np.array([4.0, 3.0])
    sign = np.array([1.0, -1.0])
    turned = leg.inverse_dynamics(sign * q, sign * qd, sign * qdd, dh=True)
    assert np.allclose(sign * turned, leg.inverse_dynamics(q, qd, qdd), rtol=0, atol=1e-12)


def test_a_single_state_has_no_dimension_of_samples():
    leg = si.Leg.from_toml("mujoco-leg")
    many = leg.regressor([[0.1, 0.2]], [[0, 0]], [[0, 0]])
    one = leg.regressor([0.1, 0.2], [0, 0], [0, 0])
    assert one.shape == (2, 28) and np.array_equal(one, many[0])
    assert leg.inverse_dynamics([0.1, 0.2], [0, 0], [0, 0]).shape == (2,)


def test_samples_on_all_cores_equal_single_ones(states):
    leg = si.Leg.from_toml("mujoco-leg")
    many = leg.regressor(*states)
    for sample in (0, 255, 256, 399):
        assert np.array_equal(many[sample], leg.regressor(*(array[sample] for array in states)))


def test_parameters_are_named():
    leg = si.Leg.from_toml("mujoco-leg")
    assert leg.joints == ["hip", "knee"]
    assert leg.parameter_names[:3] == ["XX1", "XY1", "XZ1"] and leg.parameter_names[-1] == "OFF2"
    assert leg.parameters("truth").shape == (28,)


def test_a_leg_file_is_written_and_read(tmp_path):
    leg = si.Leg.from_toml("mujoco-leg")
    leg.save(tmp_path / "leg.toml")
    again = si.Leg.from_toml(tmp_path / "leg.toml")
    assert np.array_equal(again.parameters(), leg.parameters())
    with pytest.raises(si.InputError, match="exists"):
        leg.save(tmp_path / "leg.toml")
