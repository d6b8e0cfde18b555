"""Arguments that cannot be used: a sentence that says which, and how."""

import numpy as np
import pytest

import scarab_ident as si


@pytest.fixture(scope="module")
def leg():
    return si.Leg.from_toml("mujoco-leg")


def test_a_shape(leg):
    with pytest.raises(si.InputError, match=r"q has shape \[3, 5\]; needed is \(samples, 2\)"):
        leg.regressor(np.zeros((3, 5)), np.zeros((3, 5)), np.zeros((3, 5)))
    with pytest.raises(si.InputError, match="qdd has 4 samples, q has 3"):
        leg.regressor(np.zeros((3, 2)), np.zeros((3, 2)), np.zeros((4, 2)))
    with pytest.raises(si.InputError, match=r"recording: tau has shape \[100, 3\]; needed is \(100, 2\)"):
        leg.identify(np.arange(100.0), np.zeros((100, 2)), np.zeros((100, 3)))


def test_a_number_that_is_not_finite(leg):
    q = np.zeros((9, 2))
    q[7, 1] = np.nan
    with pytest.raises(si.InputError, match=r"q\[7, 1\] is NaN"):
        leg.inverse_dynamics(q, 0 * q, np.zeros((9, 2)))
    t = np.arange(1000) * 0.002
    tau = np.zeros((1000, 2))
    tau[17, 0] = np.inf
    with pytest.raises(si.InputError, match="recording:17: .*tau1_Nm"):
        leg.identify(t, np.zeros((1000, 2)), tau)


def test_times(leg):
    t = np.arange(1000) * 0.002
    t[500] = t[499]
    with pytest.raises(si.InputError, match="recording:500"):
        leg.identify(t, np.zeros((1000, 2)), np.zeros((1000, 2)))
    with pytest.raises(si.InputError, match="10 Hz|too slow|rate"):
        leg.identify(np.arange(1000) * 2.0, np.zeros((1000, 2)), np.zeros((1000, 2)))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"split": 1.0}, "split must be above 0 and below 1"),
        ({"bandwidth_hz": 400.0}, "at most 25 Hz"),
        ({"bandwidth_hz": "wide"}, "'auto'"),
        ({"plan": "both"}, "'one-time', 'sequential'"),
        ({"prior": "mine"}, "none, file, wrong:PERCENT"),
        ({"torque_delay_ms": [1.0, 2.0, 3.0]}, "3 values"),
        ({"payload": "2@knee:0.1"}, "belong together"),
        ({"load": "2@ankle:0.1"}, "ankle"),
    ],
)
def test_an_option(mujoco, options, words):
    leg, recording = mujoco
    with pytest.raises(si.InputError, match=words):
        leg.identify(*recording, **options)


def test_files(leg, tmp_path):
    with pytest.raises(si.InputError, match="cannot be read"):
        si.Leg.from_toml(tmp_path / "none.toml")
    (tmp_path / "bad.toml").write_text('name = "leg"\ngravity = [1.0]\n')
    with pytest.raises(si.InputError, match=r"bad.toml:2"):
        si.Leg.from_toml(tmp_path / "bad.toml")
    with pytest.raises(si.InputError, match="none.csv"):
        si.read_recording(tmp_path / "none.csv", leg)
    with pytest.raises(si.InputError, match="parallel_rad"):
        si.Leg.from_urdf(tmp_path / "none.urdf", parallel_rad=0.5)
    with pytest.raises(ValueError):
        leg.simulate(drive="other")
