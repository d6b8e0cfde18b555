"""Arguments that cannot be used: a sentence that says which, and how."""

import numpy as np
import pytest

import scarab_ident as si


@pytest.fixture(scope="module")
def leg():
    return si.Leg.from_toml("mujoco-leg")


def test_a_shape(leg):
    with pytest.raises(si.InputError, match=r"q has the shape \(3, 5\); expected \(samples, 2\)"):
        leg.regressor(np.zeros((3, 5)), np.zeros((3, 5)), np.zeros((3, 5)))
    with pytest.raises(si.InputError, match=r"qdd has the shape \(4, 2\), q has \(3, 2\)"):
        leg.regressor(np.zeros((3, 2)), np.zeros((3, 2)), np.zeros((4, 2)))
    with pytest.raises(si.InputError, match=r"recording: tau has the shape \(100, 3\); expected \(100, 2\)"):
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
        ({"split": 1.0}, "split: must be above 0 and below 1"),
        ({"bandwidth_hz": 400.0}, "bandwidth_hz 400: at most 25 Hz"),
        ({"bandwidth_hz": "wide"}, "'auto'"),
        ({"plan": "both"}, "'one-time', 'sequential'"),
        ({"prior": "mine"}, "none, file, wrong:PERCENT"),
        ({"torque_delay_ms": [1.0, 2.0, 3.0]}, "3 values"),
        ({"payload": "2@knee:0.1"}, "payload needs with_payload"),
        ({"payload": "2@knee:0.1", "with_payload": []}, "payload needs with_payload"),
        ({"temperature_c": 1e6}, "from -40 to 125"),
        ({"validate": [np.zeros(3), np.zeros(3)]}, r"validate\[0\] must be a recording \(t, q, tau\)"),
        ({"validate": (np.empty(0), np.empty((0, 2)), np.empty((0, 2)))}, "too short"),
        ({"load": "2@ankle:0.1"}, "ankle"),
    ],
)
def test_an_option(mujoco, options, words):
    leg, recording = mujoco
    with pytest.raises(si.InputError, match=words):
        leg.identify(*recording, **options)


def test_records_of_a_logger_are_read_as_numpy_reads_them(mujoco):
    leg, (t, q, tau) = mujoco
    plain = leg.inverse_dynamics(q[:50], 0 * q[:50], 0 * q[:50])
    for fields in ([("q", "<f8", 2), ("status", "<u4")], [("id", "u1"), ("q", "<f8", 2)]):
        packed = np.zeros(50, dtype=fields)
        packed["q"] = q[:50]
        assert np.array_equal(leg.inverse_dynamics(packed["q"], 0 * q[:50], 0 * q[:50]), plain)
    for other in (np.asfortranarray(q[:50]), q[:50].astype(">f8"), q[:50].tolist()):
        assert np.array_equal(leg.inverse_dynamics(other, 0 * q[:50], 0 * q[:50]), plain)


@pytest.mark.parametrize(
    ("array", "words"),
    [
        (np.ma.masked_array(np.zeros((9, 2)), mask=[[True, False]] * 9), "masked"),
        (np.zeros((9, 2), dtype=complex), "complex128"),
        (np.zeros((9, 2), dtype="datetime64[s]"), "datetime64"),
        (np.zeros((1,) * 40), "40 dimensions"),
        ([[1.0, 2.0], [3.0]], "not an array of numbers"),
        ([["a", "b"]], "expected real numbers"),
    ],
)
def test_an_array_that_holds_no_real_numbers(leg, array, words):
    with pytest.raises(si.InputError, match=words):
        leg.regressor(array, np.zeros((9, 2)), np.zeros((9, 2)))


def test_results_beyond_double_precision(leg, identified):
    for compute in (leg.regressor, leg.inverse_dynamics, identified.predict):
        with pytest.raises(si.InputError, match="sample 0 exceeds the range"):
            compute([0.0, 0.0], [1e200, 1e200], [0.0, 0.0])
    with pytest.raises(si.InputError, match=r"parameters\[3\] is NaN"):
        leg.inverse_dynamics([0, 0], [0, 0], [0, 0], parameters=[0, 0, 0, np.nan] + [0] * 24)


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
    with pytest.raises(si.InputError, match="'ideal', 'full'"):
        leg.simulate(drive="other")
