"""Impedance session and telemetry of a leg: `impedance.py HOST:PORT [NODE NODE]`.

The drive is enabled, each joint is commanded steps of its position in impedance mode, and stiffness and damping
are computed from what the joint showed: torque by its currents, position and velocity, all sent at SYNC. Both
must be within 5 % of the commanded ones. The last line is `impedance: ok`.
"""

import struct
import sys
import time

from scarab_bus import Heartbeat, Joint, MICRO, connect, enable, until

# Cycle of SYNC and targets, s; an ordinary machine keeps it to some milliseconds.
CYCLE_S = 0.005
# Stiffness (N m/rad) and damping (N m s/rad) of each joint, and its step, rad.
COMMANDED = [(200.0, 16.0), (100.0, 8.0)]
STEP_RAD = 0.12
STIFFNESS_UNIT, DAMPING_UNIT = 0.1, 0.01
IMPEDANCE, TOLERANCE = -1, 0.05
# Time constant of the low-pass of 6077, s (docs/bus.md).
LAG_S = 0.002


class Session:
    """SYNC, targets and answers of both joints, cycle by cycle."""

    def __init__(self, network, joints):
        self.network, self.joints = network, joints
        self.samples = [[] for _ in joints]
        self.targets = [None for _ in joints]
        self.before = None

    def set_up(self):
        """Maps everything that one cycle needs into two PDOs per direction."""
        for joint in self.joints:
            node = joint.number
            joint.set_up_pdo(0x1401, 0x300 + node, 1, [0x607A0020, 0x60FF0020])
            joint.set_up_pdo(0x1402, 0x400 + node, 1, [0x20200110, 0x20200210, 0x60710010])
            joint.set_up_pdo(0x1801, 0x280 + node, 1, [0x60640020, 0x606C0020])
            joint.set_up_pdo(0x1802, 0x380 + node, 1, [0x60770010])

    def cycle(self):
        """Sends the targets, then SYNC, at which all of them act together."""
        for joint, target in zip(self.joints, self.targets):
            place, velocity, stiffness, damping, torque = target
            node = joint.number
            self.network.send_message(0x300 + node, struct.pack("<ii", round(place / MICRO), round(velocity / MICRO)))
            data = struct.pack("<HHh", round(stiffness / STIFFNESS_UNIT), round(damping / DAMPING_UNIT), torque)
            self.network.send_message(0x400 + node, data)
        self.network.send_message(0x80, b"")
        time.sleep(CYCLE_S)
        # What is sent at SYNC answers to the targets of the SYNC before.
        for joint, samples, target, before, rated in zip(self.joints, self.samples, self.targets,
                                                         self.before or self.targets, self.rated):
            place, torque = joint.pdo(0x1801, "<ii"), joint.pdo(0x1802, "<h")
            if place and torque and target == before:
                # Deviation at the time that the low-passed torque shows.
                deviation, rate = target[0] - place[0] * MICRO, -place[1] * MICRO
                samples.append((deviation - LAG_S * rate, rate, torque[0] * rated))
        self.before = list(self.targets)

    def run(self, seconds):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.cycle()


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
    numbers = [int(number) for number in sys.argv[2:]] or [1, 2]
    network = connect(sys.argv[1])
    for number in numbers:
        network.send_message(0, bytes([1, number]))
    joints = [Joint(network, number) for number in numbers]
    session = Session(network, joints)
    session.rated = [joint.read(0x6076) * 1e-6 for joint in joints]
    session.set_up()
    for joint in joints:
        joint.write(0x6087, 0, 10_000)
        joint.write(0x6060, 0, IMPEDANCE, "<b")
        largest = [joint.read(0x2020, sub, "<H") for sub in (3, 4)]
        print(f"node {joint.number}: at most {largest[0] * STIFFNESS_UNIT:.0f} N m/rad,",
              f"{largest[1] * DAMPING_UNIT:.0f} N m s/rad")
    begin = [joint.position() for joint in joints]
    session.targets = [(place, 0.0, *commanded, 0) for place, commanded in zip(begin, COMMANDED)]
    alive = Heartbeat(network)
    # The targets must be there before the drive is enabled.
    session.cycle()
    enable(joints)
    for joint in joints:
        until("impedance mode", lambda: joint.read(0x6061, 0, "<b") == IMPEDANCE)
    session.run(1.0)
    for place in range(len(joints)):
        session.samples = [[] for _ in joints]
        # Flexion only: a target beyond the range would be limited to it.
        for step in (STEP_RAD, 0.0, STEP_RAD, 0.0):
            offset = [step if joint == place else 0.0 for joint in range(len(joints))]
            session.targets = [(start + away, 0.0, *commanded, 0)
                               for start, away, commanded in zip(begin, offset, COMMANDED)]
            session.run(0.8)
        shown = fitted(session.samples[place])
        for name, unit, found, commanded in zip(("stiffness", "damping"), ("N m/rad", "N m s/rad"), shown,
                                                COMMANDED[place]):
            print(f"node {joints[place].number}: {name} {found:.1f} of {commanded:.1f} {unit}")
            assert abs(found / commanded - 1) < TOLERANCE, f"{name}: {100 * (found / commanded - 1):.1f} %"
    telemetry(joints)
    for joint in joints:
        joint.write(0x6040, 0, 0, "<H")
    alive.stop()
    network.disconnect()
    print("impedance: ok")


if __name__ == "__main__":
    main()
