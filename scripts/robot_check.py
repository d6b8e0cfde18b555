#!/usr/bin/env python3
"""Converts robots of others by `scarab leg --urdf` and compares the torques of the leg file with Pinocchio's.

  scripts/venv DIR pin==4.1.0 example-robot-data==6.0.0
  DIR/bin/python scripts/robot_check.py target/debug/scarab

Every joint that is not chosen is held in the middle of its range, or at 0. The leg file's torques come from
`scarab regressor`, at 20 random states. Exit code 1 if one differs by more than 1e-9 of the largest torque.
"""

import argparse
import csv
import io
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pinocchio

ROBOTS = {
    "double_pendulum_description/urdf/double_pendulum.urdf": ["joint1", "joint2"],
    "solo_description/robots/solo12.urdf": ["FL_HAA", "FL_HFE", "FL_KFE"],
    "anymal_b_simple_description/robots/anymal.urdf": ["RH_HAA", "RH_HFE", "RH_KFE"],
    "go2_description/urdf/go2.urdf": ["FL_hip_joint", "FL_thigh_joint", "FL_calf_joint"],
    "hyq_description/robots/hyq_no_sensors.urdf": ["lf_haa_joint", "lf_hfe_joint", "lf_kfe_joint"],
    "bolt_description/robots/bolt.urdf": ["FL_HAA", "FL_HFE", "FL_KFE"],
    "g1_description/urdf/g1_29dof_rev_1_0.urdf": ["left_hip_pitch_joint", "left_knee_joint"],
    "simple_humanoid_description/urdf/simple_humanoid.urdf": ["LLEG_HIP_P", "LLEG_KNEE"],
    "panda_description/urdf/panda.urdf": ["panda_joint2", "panda_joint4"],
    "ur_description/urdf/ur5_robot.urdf": ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint"],
    "kinova_description/robots/kinova.urdf": ["j2s6s200_joint_2", "j2s6s200_joint_3"],
}
STATES = 20
MOST = 1e-9


def reduced(text, joints):
    """Model of the chosen joints, and the positions of the others."""
    model = pinocchio.buildModelFromXML(text)
    reference, held, locks = pinocchio.neutral(model), [], []
    for number in range(1, model.njoints):
        name, joint = model.names[number], model.joints[number]
        if name in joints:
            continue
        held.append(number)
        low, high = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
        at = 0.0
        if joint.nq == 1 and np.isfinite(low) and np.isfinite(high) and low < high:
            at = float(low + high) / 2
            reference[joint.idx_q] = at
        locks += ["--lock", f"{name}={at!r}"]
    return pinocchio.buildReducedModel(model, held, reference), locks


def table(command):
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    if run.returncode != 0:
        sys.exit(f"{' '.join(command)}: {run.stderr}")
    return run.stdout


def difference(program, urdf, joints, folder, random):
    text = urdf.read_text(encoding="utf-8")
    model, locks = reduced(text, joints)
    leg, states = folder / f"{urdf.stem}.toml", folder / "states.csv"
    table([program, "leg", "--urdf", str(urdf), "--joints", ",".join(joints), *locks, "--out", str(leg)])
    count = len(joints)
    motion = random.uniform(-1, 1, (STATES, count, 3)) * [2.0, 5.0, 20.0]
    header = ",".join(f"q{joint},qd{joint},qdd{joint}" for joint in range(1, count + 1))
    rows = [",".join(repr(float(value)) for value in state.flatten()) for state in motion]
    states.write_text("\n".join([header, *rows, ""]), encoding="utf-8")
    printed = table([program, "regressor", "--leg", str(leg), "--states", str(states)])
    found = np.array([[float(row[f"tau{joint + 1}"]) for joint in range(count)] for row in csv.DictReader(io.StringIO(printed))])
    data = model.createData()
    expected = np.array([
        pinocchio.rnea(model, data, pinocchio.integrate(model, pinocchio.neutral(model), state[:, 0]), state[:, 1], state[:, 2])
        for state in motion
    ])
    return abs(found - expected).max() / abs(expected).max(), len(locks) // 2


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    program = parser.parse_args().program
    robots = Path(sys.prefix)
    random = np.random.default_rng(1)
    worst = 0.0
    with tempfile.TemporaryDirectory() as folder:
        for name, joints in ROBOTS.items():
            found = sorted(robots.rglob(f"example-robot-data/robots/{name}"))
            if not found:
                sys.exit(f"{name} is not installed here: scripts/venv DIR pin example-robot-data")
            error, held = difference(program, found[0], joints, Path(folder), random)
            worst = max(worst, error)
            print(f"{name}: {len(joints)} joints, {held} held: {error:.1e} of the largest torque")
    sys.exit(int(worst > MOST))


main()
