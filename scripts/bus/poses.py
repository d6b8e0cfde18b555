"""Stop and enable from random poses: `poses.py HOST:PORT [--poses COUNT] [--seed SEED] [--leg FILE]`.

Each time the leg goes to a random pose within its range, is stopped in one of five ways that let it fall, and
is enabled again. If enabling fails, the nodes must report the reason: a new FF0E, by an emergency message or
603F, after the history was cleared. A host that only resets faults and requests again must then succeed. An
enabled leg must arrive in its range. At least a third of the falls must end outside the range, else the way
back is not tested: a leg with little friction falls far enough. The last line is `poses: ok`.
"""

import argparse
import math
import os
import random
import re
import time

from scarab_bus import MICRO, Joint, connect, holds, until

NODES = (1, 2)
DEFAULT_LEG = "x2-wearer-75kg.toml"
WAYS = ("disable voltage", "quick stop", "reset of the nodes", "connection cut", "disable operation, then shut-down and off")
STEPS = ((0x06, 0x21), (0x07, 0x23), (0x0F, 0x27))
# Time for a fallen leg to come to rest.
ENABLE_WITHIN_S, ANSWER_WITHIN_S, BACK_WITHIN_S, FALL_S = 2.0, 10.0, 60.0, 1.5
# A step towards enabled was refused.
NOT_ENABLED = 0xFF0E
# Tolerance of the range.
TOLERANCE = math.radians(0.5)


class Leg:
    """A connection and its joints."""

    def __init__(self, address):
        self.address = address
        self.open()

    def open(self):
        self.network = connect(self.address)
        self.network.nmt.state = "OPERATIONAL"
        self.joints = [Joint(self.network, number) for number in NODES]

    def close(self):
        self.network.disconnect()


def is_up(joints, longest_s):
    """Sends 6, 7, F and returns whether the leg is enabled. Each step has its own time.

    On a busy machine a write may take longer than a step: the library sends it again after 5 s.
    """
    for word, state in STEPS:
        for joint in joints:
            joint.write(0x6040, 0, word, "<H")
        if not holds(lambda: all(joint.read(0x6041, 0, "<H") & 0x806F == state for joint in joints), longest_s):
            return False
    return True


def is_enabled(joints):
    """Whether the leg is enabled."""
    return all(joint.read(0x6041, 0, "<H") & 0x806F == 0x27 for joint in joints)


def off(joints):
    """Resets faults and sends controlword 0."""
    for joint in joints:
        joint.write(0x6040, 0, 0x00, "<H")
        joint.write(0x6040, 0, 0x80, "<H")
        joint.write(0x6040, 0, 0x00, "<H")


def is_up_again(joints):
    """Resets and requests again until the leg is enabled: it may swing for a while. Returns whether it is."""
    end = time.monotonic() + BACK_WITHIN_S
    while time.monotonic() < end:
        off(joints)
        if is_up(joints, ENABLE_WITHIN_S):
            return True
    return False


def ranges(path):
    """Reads the joints' ranges of a leg file, rad."""
    with open(path, encoding="utf-8") as file:
        found = re.findall(r"^range_deg = \[(.+), (.+)\]", file.read(), re.MULTILINE)
    return [tuple(math.radians(float(end)) for end in pair) for pair in found]


def pose(joints, limits, dice):
    """Moves to a random pose within the range; fails if the leg does not arrive."""
    goals = []
    for joint, (low, high) in zip(joints, limits):
        goals.append(round(dice.uniform(low + 0.02 * (high - low), high - 0.02 * (high - low)) / MICRO))
        joint.write(0x6081, 0, 1_500_000)
        joint.write(0x607A, 0, goals[-1], "<i")
        joint.write(0x6060, 0, 1, "<b")
        until("mode 1", lambda: joint.read(0x6061, 0, "<b") == 1)
    # A rising edge of bit 4 takes the target.
    for word in (0x0F, 0x3F):
        for joint in joints:
            joint.write(0x6040, 0, word, "<H")
    until(f"arrival at {', '.join(f'{goal * MICRO:.2f}' for goal in goals)} rad", lambda: all(
        abs(joint.position() - goal * MICRO) < 0.02 for joint, goal in zip(joints, goals)))
    return [goal * MICRO for goal in goals]


def stop(leg, way):
    """Stops the leg in a way that lets it fall."""
    joints = leg.joints
    if way in WAYS[:2]:
        for joint in joints:
            joint.write(0x6040, 0, 0x02 if way == WAYS[1] else 0x00, "<H")
    elif way == WAYS[2]:
        leg.network.nmt.send_command(129)
        time.sleep(0.2)
        leg.network.nmt.state = "OPERATIONAL"
    elif way == WAYS[3]:
        leg.close()
        leg.open()
    elif way == WAYS[4]:
        for word in (0x07, 0x06, 0x00):
            for joint in joints:
                joint.write(0x6040, 0, word, "<H")
    joints = leg.joints
    for joint in joints:
        until(f"node {joint.number} off after {way}", lambda: joint.read(0x6041, 0, "<H") & 0x4F in (0x40, 0x08))
    off(joints)
    forget(joints)
    time.sleep(FALL_S)


def forget(joints):
    """Clears old errors, so that they are not taken for the reason of a later refusal."""
    for joint in joints:
        joint.write(0x1003, 0, 0, "<B")
        joint.emergencies.clear()


def reason(joints):
    """Reasons reported by the nodes since `forget` why the leg is not enabled, with the bits of 60FD."""
    found = []
    for joint in joints:
        if NOT_ENABLED in joint.emergencies or joint.read(0x603F, 0, "<H") == NOT_ENABLED:
            found.append(f"node {joint.number}: FF0E, 60FD is {joint.read(0x60FD):08X}")
        # A fault that came during the fall has to be reset first.
        elif joint.read(0x6041, 0, "<H") & 0x4F == 0x08 and joint.read(0x603F, 0, "<H"):
            found.append(f"node {joint.number}: fault {joint.read(0x603F, 0, '<H'):04X}")
    return found


def outside(joints, limits):
    """Joints outside their range."""
    places = [(joint.number, joint.position(), low, high) for joint, (low, high) in zip(joints, limits)]
    return [f"node {number} at {place:.3f} rad, range {low:.3f} to {high:.3f}"
            for number, place, low, high in places if not low - TOLERANCE <= place <= high + TOLERANCE]


def arrive(joints, limits, where):
    """Commands the nearest position within the range, which the leg must reach. Otherwise a hand may be needed."""
    for joint, (low, high) in zip(joints, limits):
        joint.write(0x6060, 0, 0, "<b")
        middle = min(max(joint.position(), low + 0.1), high - 0.1)
        joint.write(0x607A, 0, round(middle / MICRO), "<i")
        joint.write(0x6060, 0, 1, "<b")
    for word in (0x0F, 0x3F):
        for joint in joints:
            joint.write(0x6040, 0, word, "<H")
    until(f"{where}: return into the range", lambda: not outside(joints, limits))
    off_again = [joint.number for joint in joints if joint.read(0x6041, 0, "<H") & 0x6F != 0x27]
    if off_again:
        raise SystemExit(f"{where}: nodes {off_again} stopped on the way into the range")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("address")
    parser.add_argument("--poses", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--leg", default=os.path.join(os.path.dirname(__file__), "../../host/legs", DEFAULT_LEG))
    arguments = parser.parse_args()
    count, dice, limits = arguments.poses, random.Random(arguments.seed), ranges(arguments.leg)
    leg = Leg(arguments.address)
    if not is_up_again(leg.joints):
        raise SystemExit(f"not enabled at the start: {reason(leg.joints)}")
    outsiders = 0
    refused, silent, locked = 0, [], []
    for number in range(1, count + 1):
        goals = pose(leg.joints, limits, dice)
        way = dice.choice(WAYS)
        stop(leg, way)
        outsiders += bool(outside(leg.joints, limits))
        rests = [joint.position() for joint in leg.joints]
        where = f"pose {number} ({', '.join(f'{goal:.2f}' for goal in goals)}), {way}, rests at {', '.join(f'{rest:.2f}' for rest in rests)}"
        if is_up(leg.joints, ENABLE_WITHIN_S):
            arrive(leg.joints, limits, where)
            continue
        # A busy machine delays answers by seconds; a leg that is silent stays silent.
        holds(lambda: reason(leg.joints) or is_enabled(leg.joints), ANSWER_WITHIN_S)
        why = reason(leg.joints)
        if not why and is_enabled(leg.joints):
            arrive(leg.joints, limits, where)
            continue
        states = ", ".join(f"{joint.read(0x6041, 0, '<H'):04X}" for joint in leg.joints)
        refused += 1
        print(f"{where}: not enabled; {'; '.join(why) or f'NO REASON, statuswords {states}'}", flush=True)
        if not why:
            silent.append(where)
        if not is_up_again(leg.joints):
            locked.append(where)
            print(f"{where}: LOCKED OUT", flush=True)
            # No other pose can be tried from here.
            break
        arrive(leg.joints, limits, where)
    off(leg.joints)
    leg.close()
    print(f"{number} poses, {outsiders} rests outside the range, {refused} not enabled at once, {len(silent)} of them without a reason, {len(locked)} locked out")
    if silent or locked:
        raise SystemExit("poses: failed")
    if 3 * outsiders < number:
        raise SystemExit(f"poses: only {outsiders} of {number} falls ended outside the range, a third is needed")
    print("poses: ok")


if __name__ == "__main__":
    main()
