#!/usr/bin/env python3
"""Regressor and identification beside Pinocchio and numpy, on the same data, in one run.

  scripts/venv DIR numpy pin==4.1.0
  DIR/bin/pip install ./python
  DIR/bin/python scripts/python_benchmark.py

Regressor: 100,000 random states of a leg of two joints, ten inertial parameters a link. Pinocchio's
`computeJointTorqueRegressor` takes one state a call, so Python loops over it. Both results are compared.

Identification: the MuJoCo recording. numpy does the least of what a script does: a zero-phase Butterworth-like
low-pass in the frequency domain, derivatives, regressor, one least squares. It judges nothing and finds no
outlier, delay or uncertainty by model error. Median of five runs each.
"""

import statistics
import time
from pathlib import Path

import numpy as np

import scarab_ident as si

STATES, RUNS = 100_000, 5
ROOT = Path(__file__).resolve().parent.parent


def median_s(function, runs=RUNS):
    times = []
    for _ in range(runs):
        started = time.perf_counter()
        result = function()
        times.append(time.perf_counter() - started)
    return statistics.median(times), result


def regressors():
    import pinocchio

    urdf = ROOT / "host/tool/tests/data/double_pendulum/double_pendulum_simple.urdf"
    model = pinocchio.buildModelFromUrdf(str(urdf))
    data = model.createData()
    leg = si.Leg.from_urdf(urdf)
    random = np.random.default_rng(1)
    q, qd, qdd = (random.normal(size=(STATES, 2)) * scale for scale in (1.0, 2.0, 5.0))

    def loop():
        out = np.empty((STATES, 2, 20))
        for k in range(STATES):
            out[k] = pinocchio.computeJointTorqueRegressor(model, data, q[k], qd[k], qdd[k])
        return out

    theirs_s, theirs = median_s(loop)
    ours_s, ours = median_s(lambda: leg.regressor(q, qd, qdd, inertial_only=True))
    # The frames differ, so the columns do; both must span the same torques.
    parameters = leg.parameters("prior").reshape(2, 14)[:, :10].ravel()
    stacked = np.concatenate([model.inertias[joint].toDynamicParameters() for joint in (1, 2)])
    difference = np.abs(ours @ parameters - theirs @ stacked).max()
    print(f"regressor of {STATES} states: Pinocchio in a loop {theirs_s:.3f} s, scarab_ident {ours_s:.4f} s, ratio {theirs_s / ours_s:.0f}")
    print(f"largest difference of the torques: {difference:.1e} N m")


def identifications():
    leg = si.Leg.from_toml("mujoco-leg")
    recording = si.read_recording(ROOT / "tests/data/mujoco_leg/fourier.csv", leg)
    t, q, tau = recording

    def script():
        step, cut_hz = np.median(np.diff(t)), 8.0
        grid = np.arange(t[0], t[-1], step)
        at_grid = lambda values: np.column_stack([np.interp(grid, t, column) for column in values.T])
        angle, torque = at_grid(q), at_grid(tau)
        frequency = np.fft.rfftfreq(grid.size, step)[:, None]
        gain = 1.0 / (1.0 + (frequency / cut_hz) ** 8)
        low_pass = lambda values: np.fft.irfft(np.fft.rfft(values, axis=0) * gain, grid.size, axis=0)
        angle = low_pass(angle)
        speed = np.gradient(angle, step, axis=0)
        rows = leg.regressor(angle, speed, np.gradient(speed, step, axis=0))
        rows = low_pass(rows.reshape(grid.size, -1)).reshape(rows.shape)
        inside = slice(grid.size // 20, -grid.size // 20)
        return np.linalg.lstsq(rows[inside].reshape(-1, 28), low_pass(torque)[inside].ravel(), rcond=1e-9)[0]

    numpy_s, _ = median_s(script)
    ours_s, result = median_s(lambda: leg.identify(*recording, split=0.67))
    print(f"identification: numpy's least squares {numpy_s:.3f} s, scarab_ident {ours_s:.3f} s, ratio {numpy_s / ours_s:.2f}: {result.verdict}")


if __name__ == "__main__":
    regressors()
    identifications()
