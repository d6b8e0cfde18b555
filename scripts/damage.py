#!/usr/bin/env python3
"""Damages recordings as real loggers do, to test how `scarab replay` reacts.

  scripts/damage.py --list                                    kinds, sizes, and the cause that replay should name
  scripts/damage.py delay --size 0.02 --joint 1 in.csv out.csv
  scripts/damage.py gravity --size 30 --leg my-leg.toml turned.toml

Sizes are in SI units (s, Hz, rad) or shares; angles of gravity in degrees. Without --joint every joint is
damaged. `scripts/damage_table` applies all of them and judges the verdicts.
"""

import argparse
import re
import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

GRAVITY = re.compile(r"^gravity\s*=\s*\[([^\]]*)\]", re.MULTILINE)


class Recording:
    """Times (n), angles (n, joints) and torques (n, joints) of one file."""

    def __init__(self, times, angles, torques):
        self.t, self.q, self.tau = times, angles, torques

    @classmethod
    def read(cls, path):
        with open(path) as file:
            names = [name.strip() for name in file.readline().split(",")]
        table = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)
        joints = sum(re.fullmatch(r"q\d+_rad", name) is not None for name in names)
        pick = lambda form: table[:, [names.index(form % (joint + 1)) for joint in range(joints)]].copy()
        return cls(table[:, names.index("t_s")].copy(), pick("q%d_rad"), pick("tau%d_Nm"))

    def write(self, path):
        joints = range(1, self.q.shape[1] + 1)
        header = ",".join(["t_s", *(f"q{j}_rad" for j in joints), *(f"tau{j}_Nm" for j in joints)])
        table = np.column_stack([self.t, self.q, self.tau])
        line = ",".join(["%.7f"] + ["%.9g"] * (table.shape[1] - 1)) + "\n"
        Path(path).write_text(header + "\n" + line * len(table) % tuple(table.ravel()))

    def copy(self):
        return Recording(self.t.copy(), self.q.copy(), self.tau.copy())

    @property
    def period(self):
        return float(np.median(np.diff(self.t)))


def columns(recording, joint):
    return range(recording.q.shape[1]) if joint is None else [joint - 1]


# Each function changes a list of recordings in place: the whole set of one logging chain.


def delay(recordings, size, joint):
    """Delays the torque by `size` seconds; by whole samples if the delay is a multiple of the period."""
    for r in recordings:
        even = np.max(abs(np.diff(r.t) - r.period)) < 1e-5
        shift = size / r.period
        for c in columns(r, joint):
            if even and abs(shift - round(shift)) < 1e-3:
                r.tau[:, c] = r.tau[np.maximum(np.arange(len(r.t)) - round(shift), 0), c]
            else:
                r.tau[:, c] = np.interp(r.t - size, r.t, r.tau[:, c])


def encoder_scale(recordings, size, joint):
    for r in recordings:
        for c in columns(r, joint):
            r.q[:, c] *= 1.0 + size


def largest(recordings, c):
    return max(np.max(abs(r.tau[:, c])) for r in recordings)


def clip(recordings, size, joint):
    """Clips the torque at `size` of its largest magnitude, on both sides."""
    for c in columns(recordings[0], joint):
        limit = size * largest(recordings, c)
        for r in recordings:
            r.tau[:, c] = np.clip(r.tau[:, c], -limit, limit)


def clip_one_side(recordings, size, joint):
    """Clips one side at `size` of its largest value: the positive one, unless nearly all torque is negative."""
    for c in columns(recordings[0], joint):
        top, bottom = max(np.max(r.tau[:, c]) for r in recordings), min(np.min(r.tau[:, c]) for r in recordings)
        for r in recordings:
            r.tau[:, c] = np.minimum(r.tau[:, c], size * top) if top >= -bottom else np.maximum(r.tau[:, c], size * bottom)


def clip_filtered(recordings, size, joint):
    """Clips, then applies a first-order low-pass of 50 Hz, so that no two samples are equal."""
    clip(recordings, size, joint)
    low_pass(recordings, 50.0, joint)


def gain(recordings, size, joint):
    for r in recordings:
        for c in columns(r, joint):
            r.tau[:, c] *= 1.0 + size


def flip_midway(recordings, size, joint):
    """Changes the sign of the torque after the share `size` of each file."""
    for r in recordings:
        for c in columns(r, joint):
            r.tau[round(size * len(r.t)):, c] *= -1.0


def gain_midway(recordings, size, joint):
    """Changes the torque's gain by `size` in the middle of each file."""
    for r in recordings:
        for c in columns(r, joint):
            r.tau[len(r.t) // 2:, c] *= 1.0 + size


def swap_torques(recordings, size, joint):
    for r in recordings:
        r.tau = r.tau[:, ::-1].copy()


def swap_angles(recordings, size, joint):
    for r in recordings:
        r.q = r.q[:, ::-1].copy()


def swap_joints(recordings, size, joint):
    swap_torques(recordings, size, joint)
    swap_angles(recordings, size, joint)


def jitter(recordings, size, joint):
    """Adds a normal error of `size` seconds to the time stamps, which stay sorted."""
    random = np.random.default_rng(11)
    for r in recordings:
        stamps = np.sort(r.t + size * random.standard_normal(len(r.t)))
        r.t = np.maximum.accumulate(stamps + 2e-7 * np.arange(len(stamps)))


def low_pass(recordings, size, joint):
    """Applies a first-order low-pass of `size` Hz to the torque."""
    for r in recordings:
        steps = np.diff(r.t, prepend=r.t[0] - r.period)
        shares = 1.0 - np.exp(-2.0 * np.pi * size * steps)
        for c in columns(r, joint):
            state, out = r.tau[0, c], np.empty(len(r.t))
            for k, (share, value) in enumerate(zip(shares.tolist(), r.tau[:, c].tolist())):
                state += share * (value - state)
                out[k] = state
            r.tau[:, c] = out


def held_index(r, size):
    hold = max(1, round(size / r.period))
    return np.arange(len(r.t)) // hold * hold


def hold_torque(recordings, size, joint):
    """Updates the torque every `size` seconds only, and repeats it in between."""
    for r in recordings:
        for c in columns(r, joint):
            r.tau[:, c] = r.tau[held_index(r, size), c]


def hold_angle(recordings, size, joint):
    for r in recordings:
        for c in columns(r, joint):
            r.q[:, c] = r.q[held_index(r, size), c]


def quantise(recordings, size, joint):
    """Angles of an encoder at the joint with this number of bits; a whole count stays one, whatever its last digit."""
    step = 2.0 * np.pi / 2.0**size
    for r in recordings:
        for c in columns(r, joint):
            r.q[:, c] = np.floor(r.q[:, c] / step + 1e-6) * step


def freeze(recordings, size, joint):
    """Holds all values for `size` seconds, three times in each file; time continues."""
    for r in recordings:
        for share in (0.2, 0.45, 0.6):
            first = round(share * len(r.t))
            last = first + round(size / r.period)
            for c in columns(r, joint):
                r.q[first:last, c], r.tau[first:last, c] = r.q[first, c], r.tau[first, c]


def degrees(recordings, size, joint):
    for r in recordings:
        for c in columns(r, joint):
            r.q[:, c] = np.rad2deg(r.q[:, c])


def millinewtons(recordings, size, joint):
    for r in recordings:
        for c in columns(r, joint):
            r.tau[:, c] *= 1000.0


def negate(recordings, size, joint):
    for r in recordings:
        for c in columns(r, joint):
            r.tau[:, c] *= -1.0


def reverse(recordings, size, joint):
    """Reverses the direction of a joint's angle and torque."""
    for r in recordings:
        for c in columns(r, joint):
            r.tau[:, c] *= -1.0
            r.q[:, c] *= -1.0


def push(recordings, size, joint):
    """Adds a push of 0.6 s to the first file: a half sine of `size` of the largest torque, on every joint."""
    r = recordings[0]
    first = r.t[round(0.4 * len(r.t))]
    phase = (r.t - first) / 0.6
    pulse = np.where((phase > 0.0) & (phase < 1.0), np.sin(np.pi * np.clip(phase, 0.0, 1.0)), 0.0)
    for c in columns(r, joint):
        r.tau[:, c] += size * np.max(abs(r.tau[:, c])) * pulse


def nothing(recordings, size, joint):
    return None


def turn_gravity(text, angle_deg):
    """Turns gravity in a leg file about the joints' axis."""
    x, y, z = (float(part) for part in GRAVITY.search(text)[1].split(","))
    cosine, sine = np.cos(np.deg2rad(angle_deg)), np.sin(np.deg2rad(angle_deg))
    turned = f"gravity = [{cosine * x - sine * y:.9f}, {sine * x + cosine * y:.9f}, {z}]"
    return GRAVITY.sub(turned, text)


@dataclass
class Kind:
    """A kind of damage: function, sizes, causes that name it, and requirements on a recording."""

    apply: object
    sizes: list
    causes: set
    # Whether one joint at a time is damaged, and whether all together.
    each_joint: bool = False
    all_joints: bool = True
    least_joints: int = 1
    least_training_s: float = 0.0
    show: str = "%g"
    # Name of the reported direction (`directions[]`), and its value as a function of the size.
    direction: str = ""
    injected: object = None
    changes_leg: bool = False
    # Words in the message of exit code 2 that name the fault.
    words: str = ""
    # A disturbance that robust identification must tolerate: a refusal is wrong.
    must_accept: bool = False
    # False where torque does not identify the joint: ratio of two torque scales, mirrored planar leg.
    tells_joint: bool = True


SAME = lambda size: size
KINDS = {
    "clean": Kind(nothing, [0], set(), show="-", must_accept=True),
    "delay": Kind(delay, [0.002, 0.01, 0.02, 0.06], {"delay"}, True, show="%g s", direction="delay", injected=SAME),
    "low_pass": Kind(low_pass, [20.0, 10.0, 5.0], {"torque_filter", "delay"}, show="%g Hz", direction="delay",
                     injected=lambda size: 1.0 / (2.0 * np.pi * size)),
    "encoder_scale": Kind(encoder_scale, [0.01, 0.02, 0.05], {"encoder_scale"}, True, False, show="%g", direction="encoder_scale", injected=SAME),
    "gain": Kind(gain, [0.03, 0.1, 0.3], {"torque_scale"}, True, False, 2, show="%g", direction="torque_scale", injected=SAME, tells_joint=False),
    "clip": Kind(clip, [0.8, 0.6, 0.3], {"saturation"}),
    "clip_one_side": Kind(clip_one_side, [0.8, 0.6, 0.3], {"saturation"}),
    # Its low-pass is a fault as well: 3 ms late.
    "clip_filtered": Kind(clip_filtered, [0.8, 0.6, 0.3], {"saturation", "torque_filter", "delay"}),
    "flip_midway": Kind(flip_midway, [0.25, 0.5, 0.75], {"changed_midway"}),
    "gain_midway": Kind(gain_midway, [0.1, 0.3, 1.0], {"changed_midway"}, least_training_s=8.0),
    "swap_torques": Kind(swap_torques, [0], {"joints_swapped"}, least_joints=2, show="-"),
    "swap_angles": Kind(swap_angles, [0], {"joints_swapped"}, least_joints=2, show="-"),
    "swap_joints": Kind(swap_joints, [0], {"joints_swapped"}, least_joints=2, show="-"),
    "jitter": Kind(jitter, [1e-4, 1e-3, 1e-2], {"time_stamps"}, show="%g s", words=r"t_s|time|stamp"),
    "hold_torque": Kind(hold_torque, [0.01, 0.02, 0.05], {"held_samples", "delay"}, show="%g s", direction="delay",
                        injected=lambda size: 0.5 * size),
    "hold_angle": Kind(hold_angle, [0.01, 0.02, 0.05], {"held_samples", "delay"}, show="%g s", direction="delay",
                       injected=lambda size: -0.5 * size),
    "quantise": Kind(quantise, [14, 12, 10], {"encoder_steps"}, show="%g bits"),
    "freeze": Kind(freeze, [0.2, 0.5, 1.0], {"held_samples"}, show="%g s", least_training_s=8.0),
    "gravity": Kind(None, [5.0, 30.0, 180.0], {"gravity"}, least_joints=2, show="%g deg", changes_leg=True, direction="gravity", injected=SAME),
    "degrees": Kind(degrees, [0], {"angle_unit"}, True, show="-", words=r"degree|unit"),
    "millinewtons": Kind(millinewtons, [0], {"torque_unit"}, show="-", words=r"mN|unit"),
    "negate": Kind(negate, [0], {"torque_sign"}, True, show="-"),
    "reverse": Kind(reverse, [0], {"direction"}, True, False, 2, show="-", tells_joint=False),
    "push": Kind(push, [0.1, 0.3, 0.6], set(), least_training_s=15.0, must_accept=True),
}


@dataclass
class Damage:
    """One row of the table: a kind at one size on one joint, or on all (None)."""

    name: str
    size: float
    joint: int | None
    kind: Kind = field(repr=False)

    @property
    def label(self):
        return "-" if self.kind.show == "-" else self.kind.show % self.size

    def injected(self, joints):
        """Injected size as reported directions: (name, joint) -> value; empty without a direction."""
        if not self.kind.direction:
            return {}
        touched = [None] if self.kind.changes_leg else range(1, joints + 1) if self.joint is None else [self.joint]
        return {(self.kind.direction, joint): self.kind.injected(self.size) for joint in touched}


CHOICE = re.compile(r"(?P<name>\w+)(=(?P<size>[^@]+))?(@(?P<joint>\w+))?")


@dataclass
class Choice:
    """A kind of damage, `KIND[=SIZE][@JOINT]`: one size or all, one joint, `all` joints together, or either."""

    name: str
    size: float | None
    joint: str | None

    @classmethod
    def parse(cls, text):
        parts = CHOICE.fullmatch(text)
        if not parts or parts["name"] not in KINDS:
            raise ValueError(f"`{text}` is not KIND[=SIZE][@JOINT] with a known kind")
        choice = cls(parts["name"], float(parts["size"]) if parts["size"] else None, parts["joint"])
        if choice.size is not None and choice.size not in KINDS[choice.name].sizes:
            raise ValueError(f"`{text}`: sizes of {choice.name}: {', '.join(map(str, KINDS[choice.name].sizes))}")
        return choice

    def holds(self, row):
        return self.name == row.name and self.size in (None, row.size) and self.joint in (None, str(row.joint or "all"))


def rows(joints, training_s, choices=None):
    """All damages possible for a recording with this number of joints and duration of training data."""
    for row in every_row(joints, training_s):
        if choices is None or any(choice.holds(row) for choice in choices):
            yield row


def every_row(joints, training_s):
    for name, kind in KINDS.items():
        if joints < kind.least_joints or training_s < kind.least_training_s:
            continue
        which = [None] if kind.all_joints else []
        if kind.each_joint and (joints > 1 or not which):
            which += range(1, joints + 1)
        for size in kind.sizes:
            for joint in which:
                yield Damage(name, size, joint, kind)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--list", action="store_true", help="print kinds, sizes and causes")
    parser.add_argument("kind", nargs="?", choices=list(KINDS))
    parser.add_argument("source", nargs="?", type=Path)
    parser.add_argument("target", nargs="?", type=Path)
    parser.add_argument("--size", type=float, default=0.0)
    parser.add_argument("--joint", type=int, help="from 1; every joint unless given")
    parser.add_argument("--leg", action="store_true", help="the files are leg files (gravity)")
    options = parser.parse_intermixed_args()
    if options.list:
        for name, kind in KINDS.items():
            sizes = "" if kind.show == "-" else ", ".join(kind.show % size for size in kind.sizes)
            print(f"{name:14} {sizes:32} {' or '.join(sorted(kind.causes)) or 'accepted'}")
        return
    if not options.target:
        parser.error("KIND IN OUT are missing")
    kind = KINDS[options.kind]
    if kind.changes_leg:
        options.target.write_text(turn_gravity(options.source.read_text(), options.size))
        return
    recording = Recording.read(options.source)
    if options.joint is not None and not 1 <= options.joint <= recording.q.shape[1]:
        sys.exit(f"error: --joint {options.joint}: the recording has {recording.q.shape[1]}")
    kind.apply([recording], options.size, options.joint)
    recording.write(options.target)


if __name__ == "__main__":
    main()
