#!/usr/bin/env python3
"""Writes robot descriptions (URDF) with torques by Pinocchio, which `cargo sim leg --urdf` is tested against.

  scripts/venv DIR pin==4.1.0
  DIR/bin/python scripts/robot_vectors.py host/tool/tests/data/robots.json

Each robot has one to three revolute joints in a chain, with links on fixed joints before, between and behind
them, inertial frames turned at random, and in some robots a side branch whose moving joint is locked. The axes
are random, parallel, opposite, intersecting or coaxial. The last robot is one of others. Pinocchio builds the model, locks the joints that
are not chosen, and computes the torque of the rigid bodies (Featherstone's recursive Newton-Euler
algorithm) at random states. The seed is fixed.

JSON: `pinocchio` (version), `robots[]`: `name`, `urdf`, `joints`, `lock` (joint: position), `gravity` in the
root's frame [m/s2], `states[]`: `q`, `qd`, `qdd`, `torque` [rad, s, N m].
"""

import argparse
import json
from pathlib import Path

import numpy as np
import pinocchio

STATES = 6
# Robot of others, from the package example-robot-data 6.0.0; its licence lies beside it.
REAL = Path(__file__).parent.parent / "host/tool/tests/data/double_pendulum/double_pendulum_simple.urdf"


def numbers(values):
    return " ".join(repr(float(value)) for value in values)


def origin(random, reach=0.4, turn=3.0):
    return random.uniform(-reach, reach, 3), random.uniform(-turn, turn, 3)


def inertial(random):
    """Link of eight random point masses: its tensor is possible by construction."""
    points = random.uniform(-0.15, 0.15, (8, 3))
    points -= points.mean(axis=0)
    mass = random.uniform(0.3, 6.0)
    tensor = mass / 8 * sum(point @ point * np.eye(3) - np.outer(point, point) for point in points)
    place, turn = origin(random, 0.3)
    elements = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    inertia = " ".join(f'{name}="{float(tensor[at])!r}"' for name, at in elements.items())
    return (
        f'    <inertial><origin xyz="{numbers(place)}" rpy="{numbers(turn)}"/><mass value="{mass!r}"/>\n'
        f"      <inertia {inertia}/></inertial>\n"
    )


class Robot:
    def __init__(self, name, random):
        self.name, self.random, self.parts = name, random, []
        self.link("root", has_body=False)

    def link(self, name, has_body=True):
        body = inertial(self.random) if has_body else ""
        self.parts.append(f'  <link name="{name}">\n{body}  </link>\n')

    def joint(self, name, kind, parent, child, place, turn, axis=(1.0, 0.0, 0.0), has_body=True):
        self.link(child, has_body)
        limit = ""
        if kind in ("revolute", "prismatic"):
            limit = '<limit lower="-1.25" upper="2.0" effort="60" velocity="4"/>'
        self.parts.append(
            f'  <joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>\n'
            f'    <origin xyz="{numbers(place)}" rpy="{numbers(turn)}"/><axis xyz="{numbers(axis)}"/>{limit}'
            f'<dynamics damping="0.7" friction="1.5"/></joint>\n'
        )

    def text(self):
        return f'<?xml version="1.0"?>\n<robot name="{self.name}">\n{"".join(self.parts)}</robot>\n'


def axis_of(kind, number, random):
    """Axis, position and turn of a joint in the link before it."""
    place, turn = origin(random)
    if kind in ("parallel", "opposite"):
        sign = -1.0 if kind == "opposite" and number == 1 else 1.0
        return (0.0, sign, 0.0), place, (0.0, turn[1], 0.0)
    if kind == "intersecting":
        axes = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
        return axes[number], place if number == 0 else (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if kind == "coaxial":
        return (0.0, 0.0, 1.0), (0.0, 0.0, place[2]) if number else place, (0.0, 0.0, 0.3)
    if kind == "two parallel, one crossed":
        axes = [(0.0, 1.0, 0.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)]
        return axes[number], place, (0.0, 0.0, 0.0)
    if kind == "one crossed, two parallel":
        axes = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)]
        return axes[number], place, (0.0, 0.0, 0.0)
    return random.normal(size=3), place, turn


def robot(name, kind, count, extras, random):
    built = Robot(name, random)
    parent = "root"
    if extras:
        place, turn = origin(random)
        built.joint("mount", "fixed", parent, "socket", place, turn)
        parent = "socket"
    joints, lock = [], {}
    for number in range(count):
        axis, place, turn = axis_of(kind, number, random)
        joint, child = f"axis {number + 1}", f"link {number + 1}"
        built.joint(joint, "continuous" if extras and number == 0 else "revolute", parent, child, place, turn, axis)
        joints.append(joint)
        parent = child
        if extras:
            place, turn = origin(random)
            if kind in ("parallel", "opposite"):
                turn = (0.0, turn[1], 0.0)
            elif kind == "intersecting":
                place, turn = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
            built.joint(f"weld {number + 1}", "fixed", child, f"plate {number + 1}", place, turn)
            place, turn = origin(random)
            built.joint(f"pod joint {number + 1}", "fixed", child, f"pod {number + 1}", place, turn)
            parent = f"plate {number + 1}"
    if extras:
        place, turn = origin(random)
        built.joint("wrist", "revolute", parent, "hand", place, turn, random.normal(size=3))
        place, turn = origin(random)
        built.joint("slide", "prismatic", "hand", "finger", place, turn, random.normal(size=3))
        place, turn = origin(random)
        built.joint("other arm", "revolute", "root", "other link", place, turn, (0.0, 0.0, 1.0))
        lock = {"wrist": 0.6, "slide": -0.11}
    return built.text(), joints, lock


def torques(text, joints, lock, gravity, random):
    model = pinocchio.buildModelFromXML(text)
    held = [model.getJointId(name) for name in list(model.names)[1:] if name not in joints]
    # A continuous joint has the coordinates cos q, sin q; it is always chosen here.
    reference = pinocchio.neutral(model)
    for name, value in lock.items():
        reference[model.joints[model.getJointId(name)].idx_q] = value
    model = pinocchio.buildReducedModel(model, held, reference)
    assert list(model.names)[1:] == joints
    assert all(body.mass > 0 for body in list(model.inertias)[1:])
    model.gravity.linear = np.array(gravity)
    data = model.createData()
    states = []
    for _ in range(STATES):
        q, qd, qdd = (random.uniform(-most, most, model.nv) for most in (3.0, 5.0, 20.0))
        coordinates = pinocchio.integrate(model, pinocchio.neutral(model), q)
        torque = pinocchio.rnea(model, data, coordinates, qd, qdd)
        states.append({"q": list(q), "qd": list(qd), "qdd": list(qdd), "torque": list(torque)})
    return states


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out")
    out = parser.parse_args().out
    random = np.random.default_rng(20261126)
    kinds = [(kind, count, extras) for count in (1, 2, 3) for kind in ("random",) for extras in (False, True)]
    kinds += [("parallel", 2, False), ("parallel", 3, True), ("opposite", 2, True), ("opposite", 3, False)]
    kinds += [("intersecting", 2, False), ("intersecting", 3, True), ("coaxial", 2, False)]
    kinds += [("two parallel, one crossed", 3, False), ("one crossed, two parallel", 3, False)]
    robots = []
    for kind, count, extras in kinds:
        name = f"{kind} {count}{' with extras' if extras else ''}"
        text, joints, lock = robot(name, kind, count, extras, random)
        gravity = [0.0, 0.0, -9.81] if not extras else [3.0, -2.0, -8.5]
        states = torques(text, joints, lock, gravity, random)
        robots.append(
            {"name": name, "urdf": text, "joints": joints, "lock": lock, "gravity": gravity, "states": states}
        )
    text, joints, gravity = REAL.read_text(encoding="utf-8"), ["joint1", "joint2"], [0.0, 0.0, -9.81]
    states = torques(text, joints, {}, gravity, random)
    name = "double pendulum of example-robot-data"
    robots.append({"name": name, "urdf": text, "joints": joints, "lock": {}, "gravity": gravity, "states": states})
    with open(out, "w", encoding="utf-8") as file:
        # One line for each robot and state, so that a change of one shows as such.
        lines = []
        for one in robots:
            states = ",\n  ".join(json.dumps(state) for state in one.pop("states"))
            lines.append(f'{json.dumps(one)[:-1]}, "states": [\n  {states}\n ]}}')
        file.write(f'{{"pinocchio": "{pinocchio.__version__}", "robots": [\n {(",%s " % chr(10)).join(lines)}\n]}}\n')


main()
