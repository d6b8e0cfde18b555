"""Impedance session and telemetry of a leg: `impedance.py HOST:PORT [SLOWER]`.

The drive is enabled, each joint is commanded steps of its position in impedance mode, and stiffness and damping
are computed from what the joint showed: torque by its currents, position and velocity, all sent at SYNC. Both
must be within 5 % of the commanded ones. SLOWER stretches all times for a board that is simulated more slowly
than real time. The last line is `impedance: ok`.
"""

import struct
import sys
import time

from scarab_bus import Heartbeat, Joint, MICRO, connect, enable, until

# Cycle of SYNC and targets, s; an ordinary machine keeps it to some milliseconds.
CYCLE_S = 0.005
# Stiffness (N m/rad) and damping (N m s/rad) of each joint.
COMMANDED = [(200.0, 16.0), (100.0, 8.0)]
# Flexion only, rad: a target beyond the range, or a swing beyond it, would be limited.
STEP_RAD = (0.35, 0.10)
# Steps there and back. The noise of the measured torque scatters the damping by 1 % with that many.
STEPS = 6
STIFFNESS_UNIT, DAMPING_UNIT = 0.1, 0.01
IMPEDANCE, TOLERANCE = -1, 0.05
# Time constant of the low-pass of 6077, s (docs/bus.md).
LAG_S = 0.002
# SYNCs around an answer whose targets must be the same; a busy machine drops some.
CERTAIN = 8
# Trials of the session.
TRIALS = 5


class Session:
    """SYNC, targets and answers of both joints, cycle by cycle."""

    def __init__(self, network, joints, slower):
        self.network, self.joints, self.slower = network, joints, slower
        for joint in joints:
            # Position target at each SYNC, and the answers in the same order, however late they come.
            joint.at_sync, joint.answers = [], []
        self.targets = [None for _ in joints]

    def set_up(self):
        """Maps everything that one cycle needs into two PDOs per direction."""
        for joint in self.joints:
            node = joint.number
            joint.set_up_pdo(0x1401, 0x300 + node, 1, [0x607A0020, 0x60FF0020])
            joint.set_up_pdo(0x1402, 0x400 + node, 1, [0x20200110, 0x20200210, 0x60710010])
            joint.set_up_pdo(0x1801, 0x280 + node, 1, [0x60640020, 0x606C0020])
            joint.set_up_pdo(0x1802, 0x380 + node, 1, [0x60770010])
            self.network.subscribe(0x380 + node, lambda _, data, when, joint=joint: self.take(joint, data))

    def take(self, joint, data):
        """Keeps what the joint showed at a SYNC: the second PDO completes the first."""
        place, velocity = joint.pdo(0x1801, "<ii")
        joint.answers.append((place * MICRO, velocity * MICRO, struct.unpack("<h", data)[0] * joint.rated))

    def cycle(self):
        """Sends the targets, then SYNC, at which all of them act together."""
        for joint, target in zip(self.joints, self.targets):
            place, velocity, stiffness, damping, torque = target
            node = joint.number
            joint.at_sync.append(place)
            self.network.send_message(0x300 + node, struct.pack("<ii", round(place / MICRO), round(velocity / MICRO)))
            data = struct.pack("<HHh", round(stiffness / STIFFNESS_UNIT), round(damping / DAMPING_UNIT), torque)
            self.network.send_message(0x400 + node, data)
        self.network.send_message(0x80, b"")
        time.sleep(self.slower * CYCLE_S)

    def run(self, seconds):
        end = time.monotonic() + self.slower * seconds
        while time.monotonic() < end:
            self.cycle()

    def steps(self, begin):
        """Enables the drive and commands steps of each joint in turn; returns the SYNCs without an answer."""
        for joint in self.joints:
            joint.at_sync.clear()
            joint.answers.clear()
        self.targets = [(place, 0.0, *commanded, 0) for place, commanded in zip(begin, COMMANDED)]
        # The targets must be there before the drive is enabled.
        self.cycle()
        enable(self.joints)
        for joint in self.joints:
            until("impedance mode", lambda: joint.read(0x6061, 0, "<b") == IMPEDANCE)
        self.run(1.0)
        for moved in self.joints:
            moved.first = len(moved.at_sync)
            for step in STEPS * STEP_RAD:
                self.targets = [(place + (step if joint is moved else 0.0), 0.0, *commanded, 0)
                                for joint, place, commanded in zip(self.joints, begin, COMMANDED)]
                self.run(0.5)
            moved.last = len(moved.at_sync)
        for joint in self.joints:
            joint.write(0x6040, 0, 0, "<H")
        return max(len(joint.at_sync) - len(joint.answers) for joint in self.joints)


def samples(joint):
    """Deviation, its rate and torque of a joint's answers during its steps, while its target stays the same."""
    for number, (place, velocity, torque) in enumerate(joint.answers[joint.first:joint.last], joint.first):
        targets = set(joint.at_sync[max(number - CERTAIN, 0):number + CERTAIN])
        if len(targets) == 1:
            # Deviation at the time that the low-passed torque shows.
            yield targets.pop() - place + LAG_S * velocity, -velocity, torque


def fitted(samples):
    """Stiffness and damping by least squares of torque over deviation and velocity, with an offset."""
    count = len(samples)
    means = [sum(sample[place] for sample in samples) / count for place in range(3)]
    deviations = [[value - mean for value, mean in zip(sample, means)] for sample in samples]
    dot = lambda a, b: sum(sample[a] * sample[b] for sample in deviations)
    determinant = dot(0, 0) * dot(1, 1) - dot(0, 1) ** 2
    return ((dot(1, 1) * dot(0, 2) - dot(0, 1) * dot(1, 2)) / determinant,
            (dot(0, 0) * dot(1, 2) - dot(0, 1) * dot(0, 2)) / determinant)


def telemetry(joints):
    """Telemetry of each joint in words; values that are impossible at rest fail."""
    for joint in joints:
        volt = joint.read(0x6079) / 1e3
        bridge, winding = (joint.read(0x2170, sub, "<h") / 10 for sub in (2, 3))
        currents = [joint.read(0x2170, sub, "<h") / 100 for sub in (4, 5, 6)]
        assert 20 < volt < 58 and -20 < bridge < 100 and -20 < winding < 150, (volt, bridge, winding)
        assert all(abs(current) < 60 for current in currents), currents
        assert joint.read(0x2170, 1) == 0
        print(f"node {joint.number}: {volt:.1f} V, bridge {bridge:.1f}, winding {winding:.1f} degrees Celsius, phases",
              ", ".join(f"{current:.2f} A" for current in currents))


def main():
    numbers = [1, 2]
    network = connect(sys.argv[1])
    for number in numbers:
        network.send_message(0, bytes([1, number]))
    joints = [Joint(network, number) for number in numbers]
    session = Session(network, joints, float(sys.argv[2]) if len(sys.argv) > 2 else 1.0)
    for joint in joints:
        joint.rated = joint.read(0x6076) * 1e-6
    session.set_up()
    for joint in joints:
        joint.write(0x6087, 0, 10_000)
        joint.mode = joint.read(0x6060, 0, "<b")
        joint.write(0x6060, 0, IMPEDANCE, "<b")
        # This host may be slow.
        joint.write(0x2013, 0, 0, "<B")
        largest = [joint.read(0x2020, sub, "<H") for sub in (3, 4)]
        print(f"node {joint.number}: at most {largest[0] * STIFFNESS_UNIT:.0f} N m/rad,",
              f"{largest[1] * DAMPING_UNIT:.0f} N m s/rad")
    begin = [joint.position() for joint in joints]
    alive = Heartbeat(network)
    for _ in range(TRIALS):
        lost = session.steps(begin)
        if lost < CERTAIN:
            break
        print(f"{lost} SYNCs were not answered on a busy machine; again")
    else:
        raise SystemExit(f"too many SYNCs were not answered, {TRIALS} times")
    for joint, commanded_values in zip(joints, COMMANDED):
        shown = fitted(list(samples(joint)))
        for name, unit, found, commanded in zip(("stiffness", "damping"), ("N m/rad", "N m s/rad"), shown,
                                                commanded_values):
            print(f"node {joint.number}: {name} {found:.1f} of {commanded:.1f} {unit}")
            assert abs(found / commanded - 1) < TOLERANCE, f"{name}: {100 * (found / commanded - 1):.1f} %"
    telemetry(joints)
    for joint in joints:
        joint.write(0x6060, 0, joint.mode, "<b")
        joint.write(0x2013, 0, 1, "<B")
    alive.stop()
    network.disconnect()
    print("impedance: ok")


if __name__ == "__main__":
    main()
