#!/usr/bin/env python3
"""Simulates two-link arms with stiction, independent of firmware and `hal-sim`, as a reference for `replay`.

  scripts/independent_plant.py --out DIR              40 arms: recordings, leg files, truth
  scripts/independent_plant.py --self-check           energy balance and inverse dynamics only
  scripts/independent_plant.py --out DIR --rate 1000 --encoder-bits 14 --stribeck 0.4

Each draw is one arm with its own lengths, masses, friction, encoders, noise, motion and wrong prior. All
draws are simulated at once, as numpy vectors. DIR/draw-NN holds

  train.csv      recording to identify from (t_s, q1_rad, q2_rad, tau1_Nm, tau2_Nm)
  valid.csv      recording of another motion of the same arm
  clean.csv      valid.csv without torque noise: t_s, qd1_radps, qd2_radps, tau1_Nm, tau2_Nm (time and sense of valid.csv)
  leg.toml       geometry, encoders and a wrong prior; no truth
  truth.json     the true parameters in the joints' frames, the inertias, the friction, the noise

Equations. With absolute link angles phi1 = q1, phi2 = q1 + q2, x axis along gravity, and the centres of mass
as complex numbers c1, c2 in their links (real part along the link), the Lagrangian is

  T = (J1 phi1'^2 + J2 phi2'^2) / 2 + K phi1' phi2' + (R1 q1'^2 + R2 q2'^2) / 2
  U = -g Re((m1 c1 + m2 l1) exp(i phi1) + m2 c2 exp(i phi2))
  J1 = I1 + m1 |c1|^2 + m2 l1^2,  J2 = I2 + m2 |c2|^2,  K = m2 l1 Re(c2 exp(i q2))

so that, in joint coordinates,

  M11 = J1 + J2 + 2 K + R1,   M12 = J2 + K,   M22 = J2 + R2
  h1 = K' (phi2'^2 - phi1'^2) + dU/dphi1 + dU/dphi2,   h2 = -K' phi1'^2 + dU/dphi2

Friction is a set-valued force, FC Sgn(q') + FV q', with real sticking. Steps of 0.25 ms follow Moreau's
time-stepping scheme on staggered velocities: the friction impulses of both joints solve a complementarity
problem, here in closed form (Acary and Brogliato, Numerical Methods for Nonsmooth Dynamical Systems, 2008).
The self-check uses another derivation, Newton and Euler's laws for each link.
"""

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np

STEP = 2.5e-4
CONTROL_STEPS = 4
GRAVITY = 9.81
TRAINING_S = 24.0
VALIDATION_S = 12.0


class Arms:
    """Parameters of many arms; every field is a vector with one element for each arm."""

    FIELDS = ["l1", "l2", "m1", "m2", "x1", "y1", "x2", "y2", "i1", "i2", "r1", "r2", "fc1", "fc2", "fv1", "fv2"]

    def __init__(self, **fields):
        for name in self.FIELDS:
            setattr(self, name, np.asarray(fields[name], float))
        self.c1 = self.x1 + 1j * self.y1
        self.c2 = self.x2 + 1j * self.y2
        self.j1 = self.i1 + self.m1 * abs(self.c1) ** 2 + self.m2 * self.l1**2
        self.j2 = self.i2 + self.m2 * abs(self.c2) ** 2

    @classmethod
    def draw(cls, random, count):
        """Draws arms from a small robot's to a leg's size."""
        uniform = lambda low, high: random.uniform(low, high, count)
        # The leg file states the first link's length with six digits.
        f = {"l1": np.round(uniform(0.25, 0.5), 6), "l2": uniform(0.25, 0.45)}
        f["m1"] = np.exp(uniform(np.log(1.0), np.log(9.0)))
        f["m2"] = f["m1"] * uniform(0.4, 0.8)
        for link in "12":
            length, mass = f["l" + link], f["m" + link]
            f["x" + link] = length * uniform(0.4, 0.65)
            f["y" + link] = length * uniform(-0.08, 0.08)
            f["i" + link] = mass * (length * uniform(0.27, 0.33)) ** 2
        own = f["i1"] + f["m1"] * f["x1"] ** 2 + f["m2"] * f["l1"] ** 2
        f["r1"] = own * uniform(0.05, 0.5)
        f["r2"] = (f["i2"] + f["m2"] * f["x2"] ** 2) * uniform(0.2, 1.5)
        weight1 = GRAVITY * (f["m1"] * f["x1"] + f["m2"] * f["l1"])
        weight2 = GRAVITY * f["m2"] * f["x2"]
        f["fc1"], f["fc2"] = weight1 * uniform(0.05, 0.15), weight2 * uniform(0.08, 0.25)
        f["fv1"], f["fv2"] = weight1 * uniform(0.03, 0.12), weight2 * uniform(0.04, 0.15)
        return cls(**f)

    def repeated(self, times):
        return Arms(**{name: np.tile(getattr(self, name), times) for name in self.FIELDS})

    def inertia(self, q2):
        """Elements of the inertia matrix in joint coordinates, and dK/dq2."""
        turned = self.m2 * self.l1 * self.c2 * np.exp(1j * q2)
        coupling = turned.real
        return self.j1 + self.j2 + 2.0 * coupling + self.r1, self.j2 + coupling, self.j2 + self.r2, -turned.imag

    def gravity(self, q1, q2):
        """dU/dphi1 and dU/dphi2."""
        turn1 = np.exp(1j * q1)
        first = GRAVITY * ((self.m1 * self.c1 + self.m2 * self.l1) * turn1).imag
        second = GRAVITY * (self.m2 * self.c2 * turn1 * np.exp(1j * q2)).imag
        return first, second

    def energy(self, q, v):
        m11, m12, m22, _ = self.inertia(q[1])
        kinetic = 0.5 * (m11 * v[0] ** 2 + 2.0 * m12 * v[0] * v[1] + m22 * v[1] ** 2)
        turn1, turn2 = np.exp(1j * q[0]), np.exp(1j * (q[0] + q[1]))
        heights = (self.m1 * self.c1 + self.m2 * self.l1) * turn1 + self.m2 * self.c2 * turn2
        return kinetic - GRAVITY * heights.real

    def newton_euler(self, q, v, a):
        """Joint torque without friction from the forces on each link; shares no expression with `inertia`."""
        w1, w2, b1, b2 = v[0], v[0] + v[1], a[0], a[0] + a[1]
        e1, e2 = np.exp(1j * q[0]), np.exp(1j * (q[0] + q[1]))
        spin = lambda arm, w, b: arm * (1j * b - w**2)
        elbow = spin(self.l1 * e1, w1, b1)
        force2 = self.m2 * (elbow + spin(self.c2 * e2, w2, b2) - GRAVITY)
        force1 = self.m1 * (spin(self.c1 * e1, w1, b1) - GRAVITY)
        cross = lambda arm, force: (np.conj(arm) * force).imag
        torque2 = self.i2 * b2 + cross(self.c2 * e2, force2)
        torque1 = self.i1 * b1 + cross(self.c1 * e1, force1) + cross(self.l1 * e1, force2) + torque2
        return np.array([torque1 + self.r1 * a[0], torque2 + self.r2 * a[1]])


def friction_impulses(free, a11, a12, a22, limit1, limit2):
    """Friction forces f, |f| <= limit, such that v = free - A f sticks or slides against f.

    Each velocity falls with its own friction force, also where the other joint's force follows it. So joint 1
    slides where the largest force cannot stop it; else it sticks, and joint 2 sees the inertia of a held
    joint 1.
    """
    def other(f1):
        return np.clip((free[1] - a12 * f1) / a22, -limit2, limit2)

    forward2, backward2 = other(limit1), other(-limit1)
    slides_forward = free[0] - a11 * limit1 - a12 * forward2 >= 0.0
    slides_backward = free[0] + a11 * limit1 - a12 * backward2 <= 0.0
    stuck2 = np.clip((free[1] - a12 / a11 * free[0]) / (a22 - a12**2 / a11), -limit2, limit2)
    stuck1 = (free[0] - a12 * stuck2) / a11
    f1 = np.where(slides_forward, limit1, np.where(slides_backward, -limit1, stuck1))
    f2 = np.where(slides_forward, forward2, np.where(slides_backward, backward2, stuck2))
    return f1, f2


def simulate(arms, duration, torque, q0, v0=None, stribeck=(0.0, 0.1)):
    """Integrates; returns q, mid-step speed, acceleration, torque and friction, each (steps, 2, arms).

    `torque(step, q)` gives the motors' torque at a step. `stribeck` is the surplus of friction at rest as a
    share of FC, and the speed at which it has fallen to 1/e.
    """
    steps = round(duration / STEP)
    shape = (steps, 2, len(arms.l1))
    qs, vs, accelerations, torques, frictions = (np.empty(shape) for _ in range(5))
    q = np.array(q0, float)
    v = np.zeros_like(q) if v0 is None else np.array(v0, float)
    acceleration = np.zeros_like(q)
    for k in range(steps):
        tau = torque(k, q)
        m11, m12, m22, slope = arms.inertia(q[1])
        # The products of speeds belong to the time of q, half a step after v.
        w1 = v[0] + 0.5 * STEP * acceleration[0]
        w2 = w1 + v[1] + 0.5 * STEP * acceleration[1]
        u1, u2 = arms.gravity(q[0], q[1])
        h1, h2 = slope * (w2**2 - w1**2) + u1 + u2, u2 - slope * w1**2
        # Viscous friction acts on the mean of the old and the new speed.
        d1, d2 = 0.5 * STEP * arms.fv1, 0.5 * STEP * arms.fv2
        p1 = (m11 - d1) * v[0] + m12 * v[1] + STEP * (tau[0] - h1)
        p2 = m12 * v[0] + (m22 - d2) * v[1] + STEP * (tau[1] - h2)
        n11, n22 = m11 + d1, m22 + d2
        determinant = n11 * n22 - m12**2
        free = ((n22 * p1 - m12 * p2) / determinant, (n11 * p2 - m12 * p1) / determinant)
        a11, a12, a22 = STEP * n22 / determinant, -STEP * m12 / determinant, STEP * n11 / determinant
        limit1, limit2 = arms.fc1, arms.fc2
        if stribeck[0] > 0.0:
            limit1 = limit1 * (1.0 + stribeck[0] * np.exp(-((v[0] / stribeck[1]) ** 2)))
            limit2 = limit2 * (1.0 + stribeck[0] * np.exp(-((v[1] / stribeck[1]) ** 2)))
        f1, f2 = friction_impulses(free, a11, a12, a22, limit1, limit2)
        new = np.array([free[0] - a11 * f1 - a12 * f2, free[1] - a12 * f1 - a22 * f2])
        acceleration = (new - v) / STEP
        middle = 0.5 * (new + v)
        qs[k], vs[k], accelerations[k], torques[k] = q, middle, acceleration, tau
        frictions[k, 0] = f1 + arms.fv1 * middle[0]
        frictions[k, 1] = f2 + arms.fv2 * middle[1]
        v = new
        q = q + STEP * v
    return qs, vs, accelerations, torques, frictions


def reaching(random, times, low, high):
    """Minimum-jerk moves with pauses: s = 10 u^3 - 15 u^4 + 6 u^5 (Flash and Hogan, 1985), random targets."""
    middle, start = 0.5 * (low + high), 0.0
    here = middle
    path = np.full(len(times), middle)
    while start < times[-1]:
        target = random.uniform(low, high)
        distance = abs(target - here)
        if distance < 0.25 * (high - low):
            continue
        # Peaks of the curve: speed 1.875 distance / duration, acceleration 5.774 distance / duration^2.
        duration = max(1.875 * distance / 3.0, np.sqrt(5.774 * distance / 20.0), 0.35) * random.uniform(1.0, 1.8)
        u = np.clip((times - start) / duration, 0.0, 1.0)
        path = np.where(times >= start, here + (target - here) * u**3 * (10.0 - 15.0 * u + 6.0 * u**2), path)
        start += duration + random.uniform(0.0, 0.15)
        here = target
    return path


def sweeping(random, times, low, high):
    """A slow sine across the range and a faster one whose frequency rises and falls."""
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    slow, phase = random.uniform(0.12, 0.25), random.uniform(0.0, 2.0 * np.pi)
    base, swing, period = random.uniform(0.5, 0.7), random.uniform(0.2, 0.35), random.uniform(8.0, 14.0)
    fast = 2.0 * np.pi * (base * times - swing * period / (2.0 * np.pi) * np.sin(2.0 * np.pi * times / period))
    path = 0.62 * np.sin(2.0 * np.pi * slow * times + phase) + 0.33 * np.sin(fast + 2.0 * phase)
    return middle + half * path * np.clip(times / 2.0, 0.0, 1.0) ** 2


class Controller:
    """Position control at 1 kHz on counts: PD with filtered difference, slow integral, gravity of a wrong model."""

    def __init__(self, arms, believed, counts, path, bandwidth_hz=5.0):
        self.believed, self.counts, self.path = believed, counts, path
        m11, m12, m22, _ = arms.inertia(np.full(len(arms.l1), 0.7))
        omega = 2.0 * np.pi * bandwidth_hz
        inertia = np.array([m11 - m12**2 / m22, m22 - m12**2 / m11])
        self.stiffness, self.damping, self.integral_gain = inertia * omega**2, 2.0 * inertia * omega, inertia * omega**3 / 12.0
        self.integral = np.zeros_like(inertia)
        self.rate = np.zeros_like(inertia)
        self.last = None
        self.torque = np.zeros_like(inertia)

    def __call__(self, step, q):
        if step % CONTROL_STEPS:
            return self.torque
        period = CONTROL_STEPS * STEP
        measured = np.floor(q / self.counts) * self.counts
        target = self.path[step // CONTROL_STEPS]
        if self.last is None:
            self.last = (measured, target)
        difference = ((measured - self.last[0]) - (target - self.last[1])) / period
        self.rate += 0.12 * (difference - self.rate)
        self.last = (measured, target)
        error = target - measured
        self.integral += period * self.integral_gain * error
        u1, u2 = self.believed.gravity(target[0], target[1])
        self.torque = self.stiffness * error - self.damping * self.rate + self.integral + np.array([u1 + u2, u2])
        return self.torque


def wrong(random, value, share, count):
    return value * (1.0 + random.uniform(-share, share, count))


def generate(count, seed, rate, encoder_bits, stribeck, noise):
    random = np.random.default_rng(seed)
    arms = Arms.draw(random, count)
    prior = Arms(**{
        name: getattr(arms, name) if name[0] == "l" else wrong(random, getattr(arms, name), 0.3, count)
        for name in Arms.FIELDS
    })
    if encoder_bits:
        turns, lines = np.ones((2, count)), np.full((2, count), 2**encoder_bits)
    else:
        turns, lines = random.choice([10.0, 30.0, 50.0, 100.0], (2, count)), random.choice([8192, 16384], (2, count))
    quantum = 2.0 * np.pi / (turns * lines)
    low = np.array([random.uniform(-1.2, -0.4, count), random.uniform(-0.3, 0.3, count)])
    high = low + np.array([random.uniform(1.2, 2.0, count), random.uniform(1.3, 2.0, count)])

    # The first half of the batch is the training motion, the second half another kind of motion of the same
    # arms.
    kinds = [reaching, sweeping]
    times = np.arange(0.0, TRAINING_S + 0.01, CONTROL_STEPS * STEP)
    path = np.empty((len(times), 2, 2 * count))
    for column in range(2 * count):
        kind = kinds[(column + column // count) % 2]
        for joint in range(2):
            path[:, joint, column] = kind(random, times, low[joint, column % count], high[joint, column % count])
    both = arms.repeated(2)
    counts = np.tile(quantum, 2)
    controller = Controller(both, prior.repeated(2), counts, path)
    q, v, _, torque, _ = simulate(both, TRAINING_S, controller, path[0], stribeck=(stribeck, 0.1))

    # The logger reads the counter at an instant, and the torque's mean over one period about that instant.
    every = round(1.0 / (rate * STEP))
    if every < 1 or abs(every * rate * STEP - 1.0) > 1e-9:
        sys.exit(f"--rate {rate}: must divide {1.0 / STEP:g} Hz")
    rows = np.arange(every, len(q) - every, every)
    half = every // 2
    weights = np.ones(2 * half + 1) / max(1, 2 * half)
    if half:
        weights[[0, -1]] *= 0.5
    clean = sum(w * torque[rows + k - half] for k, w in enumerate(weights))
    measured = np.floor(q[rows] / counts) * counts + 0.5 * counts
    level = noise if noise is not None else np.tile(random.uniform(0.02, 0.06, (2, count)), 2)
    # Noise is stated for 500 Hz; at another rate the density is the same.
    sigma = level * np.sqrt(np.mean(clean**2, axis=0)) * np.sqrt(rate / 500.0)
    noisy = clean + sigma * random.standard_normal(clean.shape)
    directions = random.choice([1, -1], (2, count))
    offsets = np.round(np.rad2deg(random.uniform(-0.5, 0.5, (2, count))), 3)
    return {
        "arms": arms, "prior": prior, "t": rows * STEP, "q": measured, "qd": v[rows], "clean": clean, "noisy": noisy,
        "sigma": sigma, "turns": turns, "lines": lines, "directions": directions, "offsets": offsets, "low": low,
        "high": high, "stribeck": stribeck, "sticking": np.mean(abs(v[rows]) < 1e-9, axis=0),
    }


def write_csv(path, header, columns, form):
    table = np.column_stack(columns)
    line = ",".join(form) + "\n"
    path.write_text(header + "\n" + line * len(table) % tuple(table.ravel()))


def toml_body(arms, k, joint):
    """One link in the leg file's terms: mass, centre of mass, central inertia, rotor, friction."""
    g = lambda name: float(getattr(arms, name + str(joint + 1))[k])
    inertia = g("i")
    return (f"{{ mass = {g('m'):.5f}, com = [{g('x'):.5f}, {g('y'):.5f}, 0.0], "
            f"inertia_com = [{0.15 * inertia:.6f}, 0.0, 0.0, {inertia:.6f}, 0.0, {1.02 * inertia:.6f}], "
            f"rotor_inertia = {g('r'):.6f}, coulomb = {g('fc'):.5f}, viscous = {g('fv'):.5f}, offset = 0.0 }}")


def leg_file(run, k):
    lines = ["# Arm of scripts/independent_plant.py: geometry and encoders are true, the prior is up to 30 % wrong.",
             f'name = "plant-{k:02}"', f"gravity = [{GRAVITY}, 0.0, 0.0]"]
    for joint, name in enumerate(["shoulder", "elbow"]):
        sense, offset = run["directions"][joint, k], run["offsets"][joint, k]
        ends = sorted(sense * (np.rad2deg([run["low"][joint, k] - 0.2, run["high"][joint, k] + 0.2]) - offset))
        reach = 0.0 if joint == 0 else run["arms"].l1[k]
        lines += ["", "[[joint]]", f'name = "{name}"', f"dh = {{ alpha = 0.0, a = {reach:.6f}, d = 0.0 }}",
                  f"direction = {sense}", f"zero_offset_deg = {offset}", f"range_deg = [{ends[0]:.2f}, {ends[1]:.2f}]",
                  "torque_limit_nm = 500.0",
                  f'encoder = {{ side = "{"motor" if run["turns"][joint, k] > 1.0 else "joint"}", counts = {run["lines"][joint, k]}, ratio = {run["turns"][joint, k]} }}',
                  f"prior = {toml_body(run['prior'], k, joint)}"]
    return "\n".join(lines) + "\n"


def truth(run, k):
    arms, count = run["arms"], len(run["arms"].l1)
    own = {name: float(getattr(arms, name)[k]) for name in Arms.FIELDS}
    standard = {}
    for joint in "12":
        mass, x, y = own["m" + joint], own["x" + joint], own["y" + joint]
        standard.update({
            "M" + joint: mass, "HX" + joint: mass * x, "HY" + joint: mass * y,
            "ZZ" + joint: own["i" + joint] + mass * (x**2 + y**2), "IA" + joint: own["r" + joint],
            "FC" + joint: own["fc" + joint], "FS" + joint: own["fc" + joint] * (1.0 + run["stribeck"]), "FV" + joint: own["fv" + joint], "OFF" + joint: 0.0,
        })
    return {
        "arm": own,
        # Inertia about the joint's axis, in the joint's frame: the arm's torque is linear in it.
        "standard_parameters": standard,
        "stribeck_share": run["stribeck"],
        "noise_nm": [float(x) for x in run["sigma"][:, k]],
        "noise_validation_nm": [float(x) for x in run["sigma"][:, count + k]],
        "rms_torque_nm": [float(x) for x in np.sqrt(np.mean(run["clean"][:, :, k] ** 2, axis=0))],
        "sticking_share": [float(x) for x in run["sticking"][:, k]],
        "direction": [int(x) for x in run["directions"][:, k]],
        "zero_offset_deg": [float(x) for x in run["offsets"][:, k]],
        "encoder_step_rad": [float(2.0 * np.pi / (run["turns"][j, k] * run["lines"][j, k])) for j in range(2)],
    }


def write(run, out):
    count = len(run["arms"].l1)
    header = "t_s,q1_rad,q2_rad,tau1_Nm,tau2_Nm"
    for k in range(count):
        folder = out / f"draw-{k:02}"
        folder.mkdir(parents=True, exist_ok=True)
        sense = run["directions"][:, k]
        for name, column, duration in [("train", k, TRAINING_S), ("valid", count + k, VALIDATION_S)]:
            rows = run["t"] < duration
            angles = sense * (run["q"][rows, :, column] - np.deg2rad(run["offsets"][:, k]))
            write_csv(folder / f"{name}.csv", header, [run["t"][rows], angles, sense * run["noisy"][rows, :, column]],
                      ["%.6f", "%.9f", "%.9f", "%.6f", "%.6f"])
        speeds = sense * run["qd"][rows, :, column]
        write_csv(folder / "clean.csv", "t_s,qd1_radps,qd2_radps,tau1_Nm,tau2_Nm",
                  [run["t"][rows], speeds, sense * run["clean"][rows, :, column]], ["%.6f"] + ["%.6f"] * 4)
        (folder / "leg.toml").write_text(leg_file(run, k))
        (folder / "truth.json").write_text(json.dumps(truth(run, k), indent=1) + "\n")


def self_check():
    """Checks energy with and without friction, inverse dynamics and sticking; exits with a message on error."""
    random = np.random.default_rng(7)
    arms = Arms.draw(random, 12)
    frictionless = Arms(**{name: 0.0 * getattr(arms, name) if name[0] == "f" else getattr(arms, name) for name in Arms.FIELDS})
    start = random.uniform(-1.5, 1.5, (2, 12))
    idle = lambda step, q: np.zeros_like(q)
    q, v, _, _, _ = simulate(frictionless, 6.0, idle, start)
    energies = np.array([frictionless.energy(q[k], v[k]) for k in range(0, len(q), 50)])
    swing = np.ptp(np.array([frictionless.energy(q[k], 0.0 * v[k]) for k in range(0, len(q), 50)]), axis=0)
    drift = np.max(np.ptp(energies, axis=0) / swing)

    weight = GRAVITY * np.array([arms.m1 * arms.x1 + arms.m2 * arms.l1, arms.m2 * arms.x2])
    push = lambda step, q: weight * np.array([[0.6], [0.5]]) * np.sin(2.0 * np.pi * step * STEP * np.array([[0.7], [1.1]]))
    q, v, a, tau, friction = simulate(arms, 6.0, push, start)
    work = np.cumsum(np.sum((tau - friction) * v, axis=1), axis=0) * STEP
    # Speeds and angles of a row belong to one time; the work up to it includes half of that step's power.
    work -= 0.5 * STEP * np.sum((tau - friction) * v, axis=1)
    gained = np.array([arms.energy(q[k], v[k]) for k in range(len(q))])
    balance = np.max(abs(gained - gained[0] - (work - work[0])) / np.ptp(gained, axis=0))

    inverse = np.array([arms.newton_euler(q[k], v[k], a[k]) for k in range(len(q))])
    left = tau - friction - inverse
    misfit = np.max(np.sqrt(np.mean(left**2, axis=0)) / np.sqrt(np.mean(tau**2, axis=0)))

    resting = abs(v) < 1e-12
    limits = np.array([arms.fc1, arms.fc2])
    held = bool(np.all(abs(friction) <= (limits + np.array([arms.fv1, arms.fv2]) * abs(v)) * (1.0 + 1e-9)))
    # Dry friction opposes the speed at the end of its step.
    dry = friction - np.array([arms.fv1, arms.fv2]) * v
    against = bool(np.all(dry * (v + 0.5 * STEP * a) >= -1e-9))
    checks = [
        ("energy drift of a free swing without friction, share of its exchange", drift, 2e-5),
        ("energy minus work, share of the energy exchanged", balance, 5e-5),
        ("inverse dynamics (Newton, Euler) minus torque, share of rms torque", misfit, 5e-5),
    ]
    for name, value, limit in checks:
        print(f"{name}: {value:.1e} (limit {limit:.0e})")
    print(f"sticking: {100 * np.mean(resting):.1f} % of the joint's steps; friction within its limit: {held}; against the motion: {against}")
    if any(not value < limit for _, value, limit in checks) or not held or not against or not np.any(resting):
        sys.exit("error: the self-check failed")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", type=Path, help="folder for the draws")
    parser.add_argument("--draws", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rate", type=float, default=500.0, help="of the recordings, Hz; divides 4000 (500)")
    parser.add_argument("--encoder-bits", type=int, help="bits of an encoder at the joint; without it the encoder is at the motor")
    parser.add_argument("--stribeck", type=float, default=0.0, help="surplus of friction at rest, share of Coulomb friction (0)")
    parser.add_argument("--noise", type=float, help="torque noise per 500 Hz sample, share of rms torque (0.02 to 0.06 by draw)")
    parser.add_argument("--self-check", action="store_true", help="check the equations and stop")
    options = parser.parse_args()
    begun = time.monotonic()
    self_check()
    print(f"self-check: {time.monotonic() - begun:.1f} s")
    if options.self_check:
        return
    if not options.out:
        parser.error("--out DIR is missing")
    run = generate(options.draws, options.seed, options.rate, options.encoder_bits, options.stribeck, options.noise)
    if not np.all(np.isfinite(run["q"])) or np.max(abs(run["q"])) > 10.0:
        sys.exit("error: a simulated arm ran away")
    write(run, options.out)
    print(f"{options.draws} draws in {options.out}: {time.monotonic() - begun:.1f} s")


if __name__ == "__main__":
    main()
