"""Identification: the results of `cargo sim replay`, as arrays."""

import threading
import time

import numpy as np
import pytest

import scarab_ident as si
from conftest import ROOT


def test_a_recording_of_mujoco_is_accepted_near_its_truth(mujoco, identified):
    leg, _ = mujoco
    assert identified.accepted and identified.validated, str(identified)
    truth = identified.sums @ leg.parameters("truth")
    errors = (identified.values - truth) / identified.sigma
    # The squared distance under the covariance, in multiples of its expectation.
    distance = (identified.values - truth) @ np.linalg.solve(
        identified.covariance, identified.values - truth
    )
    assert np.abs(errors).max() < 4.0, dict(zip(identified.names, errors))
    assert distance < 3.0 * len(errors)
    assert np.allclose(np.sqrt(np.diag(identified.covariance)), identified.sigma, rtol=1e-3)


def test_the_result_is_that_of_the_program(mujoco, identified):
    report = identified.report
    assert report["verdict"] == "accepted" and report["leg"] == "mujoco-leg"
    by_name = {base["name"]: base for base in report["base_parameters"]}
    for name, value, sigma, unit in zip(
        identified.names, identified.values, identified.sigma, identified.units
    ):
        assert (by_name[name]["value"], by_name[name]["sigma"]) == (value, sigma)
        assert by_name[name]["unit"] == unit
    parameter = identified.parameters["FC1"]
    assert parameter.status == "identified" and parameter.unit == "N m" and parameter.sigma > 0
    assert identified.parameters["XX1"].status != "identified"


def test_predictions_have_the_band_of_the_covariance(mujoco, identified, states):
    leg, _ = mujoco
    tau, sigma = identified.predict(*states)
    # Regressor columns of the base parameters, by the sums: Y = Y_base @ sums on the identified space.
    base = leg.regressor(*states) @ np.linalg.pinv(identified.sums)
    if not identified.report["stribeck"]:
        variance = np.einsum("sjk,kl,sjl->sj", base, identified.covariance, base)
        assert np.allclose(base @ identified.values, tau, rtol=0, atol=1e-6 * np.abs(tau).max())
        assert np.allclose(np.sqrt(variance), sigma, rtol=1e-4, atol=1e-9)


def test_curves_of_both_parts(identified):
    training, unused = identified.motions
    assert training.role == "identified from" and unused.role == "unused, predicted"
    assert training.measured_nm.shape == training.predicted_nm.shape == (training.time_s.size, 2)
    moving = ~unused.at_rest
    error = np.sqrt(np.mean((unused.measured_nm - unused.predicted_nm)[moving] ** 2))
    assert error < 0.03 * np.abs(unused.measured_nm).mean()


def test_held_out_and_further_recordings(mujoco):
    leg, (t, q, tau) = mujoco
    third = t.size // 3
    parts = [
        (t[part], q[part], tau[part])
        for part in (slice(0, third), slice(third, 2 * third), slice(2 * third, None))
    ]
    result = leg.identify(*parts[0], also=parts[1], validate=[parts[2]])
    assert result.accepted and len(result.motions) == 3
    assert not leg.identify(t, q, tau).validated


def test_a_wrong_unit_is_refused_and_its_model_cannot_be_used(mujoco, tmp_path):
    leg, (t, q, tau) = mujoco
    result = leg.identify(t, q, -tau, split=0.67)
    assert not result.accepted and "unphysical" in result.reasons
    for use in (lambda: result.predict(q, q, q), lambda: result.save(tmp_path / "model.toml")):
        with pytest.raises(si.RefusedError, match="unphysical"):
            use()
    assert not (tmp_path / "model.toml").exists()


def test_outputs(identified, tmp_path):
    identified.save(tmp_path / "model.toml")
    identified.write_report(tmp_path / "report.html")
    assert "base" in (tmp_path / "model.toml").read_text()
    page = (tmp_path / "report.html").read_text()
    assert page.count("<svg") > 3 and "accepted" in page
    assert "verdict: accepted" in str(identified)


def test_a_figure(identified):
    pyplot = pytest.importorskip("matplotlib.pyplot")
    figure = identified.plot()
    lines = [line for axis in figure.axes for line in axis.lines]
    assert len(figure.axes) == 4 and all(len(line.get_xdata()) for line in lines)
    pyplot.close(figure)
    with pytest.raises(ValueError, match="ankle"):
        identified.plot("ankle")


def test_other_threads_run_during_an_identification(mujoco):
    leg, recording = mujoco
    done, turns = threading.Event(), 0
    worker = threading.Thread(target=lambda: (leg.identify(*recording), done.set()))
    worker.start()
    while not done.is_set():
        turns += 1
        time.sleep(0.001)
    worker.join()
    assert turns > 10


def test_columns_and_units(tmp_path):
    leg = si.Leg.from_toml("mujoco-leg")
    plain = si.read_recording(ROOT / "tests/data/mujoco_leg/fourier.csv", leg)
    renamed = tmp_path / "renamed.csv"
    table = np.column_stack([plain.t * 1e3, np.degrees(plain.q), plain.tau])
    header = "time,hip position,knee position,hip effort,knee effort"
    np.savetxt(renamed, table, delimiter=",", header=header, comments="", fmt="%.17g")
    with pytest.raises(si.InputError, match="--columns"):
        si.read_recording(renamed, leg)
    columns = "t=time,q1=hip position,q2=knee position,tau1=hip effort,tau2=knee effort"
    read = si.read_recording(renamed, leg, columns=columns, units="ms,deg")
    assert np.allclose(read.q, plain.q, rtol=0, atol=1e-12) and np.array_equal(read.tau, plain.tau)


def test_a_simulated_leg_and_a_designed_motion(tmp_path):
    leg = si.Leg.from_toml("x2-wearer-75kg")
    motion = leg.excite(duration_s=15.0, evaluations=2000)
    samples = motion.samples(100)
    assert np.allclose(np.gradient(samples.q[:, 0], samples.t)[2:-2], samples.qd[2:-2, 0], atol=0.05)
    assert np.abs(samples.qd[[0, -1]]).max() < 1e-6
    motion.save(tmp_path / "motion.toml")
    again = si.Motion.load(tmp_path / "motion.toml", leg)
    assert np.array_equal(again.samples(100).q, samples.q) and "joint_names" in again.to_trajectory(10)
    simulation = leg.simulate(motion=again, seed=2)
    result = simulation.identification
    assert result.accepted and len(simulation.validation) == 3
    errors = (result.values - result.sums @ leg.parameters("truth")) / result.sigma
    assert np.abs(errors).max() < 4.5
    replayed = leg.identify(*simulation.recording, validate=simulation.validation)
    assert replayed.accepted and replayed.names == result.names
