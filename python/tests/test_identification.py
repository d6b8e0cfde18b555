"""Identification: the results of `cargo sim replay`, as arrays."""

import json
import os
import pickle
import subprocess
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
    assert np.allclose(np.sqrt(np.diag(identified.covariance)), identified.sigma, rtol=1e-6)


@pytest.mark.skipif("SCARAB_TOOL" not in os.environ, reason="the program is not built")
def test_the_result_is_that_of_the_program(identified, tmp_path):
    file = ROOT / "tests/data/mujoco_leg/fourier.csv"
    command = [os.environ["SCARAB_TOOL"], "replay", file, "--leg", "mujoco-leg", "--split", "0.67"]
    subprocess.run([*command, "--json", tmp_path / "run.json"], check=True, capture_output=True)
    theirs, ours = json.loads((tmp_path / "run.json").read_text()), identified.report
    for report in (theirs, ours):
        del report["wall_s"], report["read"]
    assert ours == theirs


def test_attributes_and_report_agree(identified):
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
    assert not identified.report["stribeck"], "its torque would come on top"
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


def test_a_wrong_sign_is_refused_and_its_model_cannot_be_used(mujoco, tmp_path):
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
    axes = identified.plot()
    assert axes.shape == (2, 2)
    assert all(len(axis.lines) >= 2 for axis in axes.flat)
    assert all(len(line.get_xdata()) for axis in axes.flat for line in axis.lines)
    pyplot.close(axes[0, 0].figure)
    with pytest.raises(si.InputError, match="ankle"):
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


def test_several_files_of_one_kind_are_replaced_and_others_are_not(identified, tmp_path):
    model, page, other = (tmp_path / name for name in ("model.toml", "report.html", "run.csv"))
    for _ in range(2):
        identified.save(model)
        identified.write_report(page)
    other.write_text("t_s,q1_rad\n")
    for write in (lambda: identified.save(other), lambda: identified.write_report(other), lambda: identified.save(page)):
        with pytest.raises(si.InputError, match="exists and is not"):
            write()
    assert other.read_text() == "t_s,q1_rad\n"


def test_skipped_rows_and_joints_that_the_leg_lacks_give_a_warning(tmp_path):
    lines = (ROOT / "tests/data/mujoco_leg/fourier.csv").read_text().splitlines()
    first = next(number for number, line in enumerate(lines) if line.startswith("t_s"))
    damaged = tmp_path / "damaged.csv"
    damaged.write_text("\n".join([*lines[: first + 20], "broken", *lines[first + 20 :]]) + "\n")
    leg = si.Leg.from_toml("mujoco-leg")
    with pytest.warns(UserWarning, match="1 skipped"):
        si.read_recording(damaged, leg, skip_bad=True)
    with pytest.warns(UserWarning, match="holds 2 joints"):
        si.read_recording(ROOT / "tests/data/mujoco_leg/fourier.csv", si.Leg.from_toml("sp"))


def test_a_motion_of_another_leg_is_refused(tmp_path):
    leg = si.Leg.from_toml("x2-wearer-75kg")
    leg.excite(duration_s=15.0, evaluations=1000).save(tmp_path / "motion.toml")
    other = si.Leg.from_text(leg.toml.replace("direction = -1", "direction = 1", 1))
    with pytest.raises(si.InputError, match="geometry"):
        si.Motion.load(tmp_path / "motion.toml", other)


def test_legs_travel_to_other_processes():
    leg = si.Leg.from_toml("mujoco-leg")
    again = pickle.loads(pickle.dumps(leg))
    assert again.toml == leg.toml and again.joints == leg.joints


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
def test_a_forked_process_computes(states):
    leg = si.Leg.from_toml("mujoco-leg")
    expected = leg.regressor(*states).sum()
    child = os.fork()
    if child == 0:
        os._exit(0 if leg.regressor(*states).sum() == expected else 1)
    deadline = time.monotonic() + 30.0
    while time.monotonic() < deadline:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            assert status == 0
            return
        time.sleep(0.01)
    os.kill(child, 9)
    os.waitpid(child, 0)
    pytest.fail("the forked process hangs")


def test_every_public_name_has_its_docstring():
    for item in (si.Leg, si.Identification, si.Motion):
        for name in vars(item):
            if not name.startswith("_"):
                assert getattr(item, name).__doc__, f"{item.__name__}.{name}"
    assert "strictly increasing" in si.Leg.identify.__doc__
    assert "kg m2" in si.Leg.parameter_names.__doc__
    assert si.beetle_swarm.__doc__ and si.read_recording.__doc__


def test_columns_and_units(tmp_path):
    leg = si.Leg.from_toml("mujoco-leg")
    plain = si.read_recording(ROOT / "tests/data/mujoco_leg/fourier.csv", leg)
    renamed = tmp_path / "renamed.csv"
    table = np.column_stack([plain.t * 1e3, np.degrees(plain.q), plain.tau])
    header = "time,hip position,knee position,hip effort,knee effort"
    np.savetxt(renamed, table, delimiter=",", header=header, comments="", fmt="%.17g")
    with pytest.raises(si.InputError, match="columns"):
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
