"""Bandwidths of the control loops, changed at run time: `gains.py HOST:PORT [SLOWER]`.

The hip holds a position (mode 8) while a torque offset (60B2) pushes it. Position control answers with a
stiffness that is proportional to the square of its bandwidth, so half the bandwidth gives four times the
deviation. Then limits, storing and reset are checked. SLOWER stretches all times for a board that is simulated
more slowly than real time. The last line is `gains: ok`.
"""

import struct
import sys
import time

from scarab_bus import Heartbeat, Joint, MICRO, connect, enable, until

CYCLE_S, PUSH_S, CYCLIC_POSITION = 0.005, 0.25, 8
PUSH_NM = 50.0
# Bandwidths: position loop in 0.01 Hz, current loop in Hz; subindices of 2021.
POSITION, LEAST_POSITION, MOST_POSITION, CURRENT, LEAST_CURRENT, MOST_CURRENT = range(1, 7)
# "save" (1010:1), emergency while it is stored, and abort code of a value outside its limits.
SAVE, STORES, RANGE = 0x65766173, 0xFF0D, 0x06090030
# Emergency of the boards' plug, which was pulled when the host before disconnected.
UNPLUGGED = 0x8120


class Session:
    """Positions of the hip at SYNC, while both joints hold theirs."""

    def __init__(self, network, joints, slower):
        self.network, self.joints, self.slower, self.places = network, joints, slower, []
        hip = joints[0]
        hip.set_up_pdo(0x1801, 0x280 + hip.number, 1, [0x60640020, 0x606C0020])
        network.subscribe(0x280 + hip.number, self.take)
        for joint in joints:
            joint.set_up_pdo(0x1401, 0x300 + joint.number, 1, [0x607A0020])
            joint.write(0x6060, 0, CYCLIC_POSITION, "<b")
            # This host may be slow.
            joint.write(0x2013, 0, 0, "<B")

    def take(self, _, data, when):
        self.places.append(struct.unpack("<ii", data)[0] * MICRO)

    def run(self, seconds):
        end = time.monotonic() + self.slower * seconds
        while time.monotonic() < end:
            for joint, place in zip(self.joints, self.held):
                data = struct.pack("<i", round(place / MICRO))
                self.network.send_message(0x300 + joint.number, data)
            self.network.send_message(0x80, b"")
            time.sleep(self.slower * CYCLE_S)

    def deviation(self, position, current):
        """Largest deviation of the hip under pushes in both directions, rad, at these bandwidths."""
        hip = self.joints[0]
        for sub, value in ((POSITION, position), (CURRENT, current)):
            hip.write(0x2021, sub, value, "<H")
        self.held = [joint.position() for joint in self.joints]
        self.run(0.05)
        enable(self.joints)
        until("mode 8", lambda: hip.read(0x6061, 0, "<b") == CYCLIC_POSITION)
        self.run(0.5)
        push = round(PUSH_NM / (hip.read(0x6076) * 1e-6))
        found = []
        for sign in (1, -1):
            begin = hip.position()
            hip.write(0x60B2, 0, sign * push, "<h")
            self.places.clear()
            self.run(PUSH_S)
            found.append(max(abs(place - begin) for place in self.places))
            hip.write(0x60B2, 0, 0, "<h")
            self.run(0.5)
        for joint in self.joints:
            joint.write(0x6040, 0, 0, "<H")
        for joint in self.joints:
            until("off", lambda: joint.state() == 0x40)
        return sum(found) / len(found)


def refused(joint, sub, value):
    """Whether a bandwidth is refused as out of range."""
    try:
        joint.write(0x2021, sub, value, "<H")
    except Exception as error:
        return getattr(error, "code", None) == RANGE
    return False


def save(joint):
    """Stores the objects of both nodes and awaits the outcome."""
    joint.emergencies.clear()
    joint.write(0x1010, 1, SAVE)
    until("the end of the flash write", lambda: 0 in joint.emergencies)
    assert joint.emergencies == [STORES, 0], joint.emergencies


def main():
    network = connect(sys.argv[1])
    joints = [Joint(network, number) for number in (1, 2)]
    hip = joints[0]
    for joint in joints:
        network.send_message(0, bytes([1, joint.number]))
    limits = [hip.read(0x2021, sub, "<H") for sub in range(1, 7)]
    assert limits[POSITION - 1] == limits[CURRENT - 1] == 0, limits
    for sub, low, high in ((POSITION, LEAST_POSITION, MOST_POSITION), (CURRENT, LEAST_CURRENT, MOST_CURRENT)):
        low, high = limits[low - 1], limits[high - 1]
        assert refused(hip, sub, low - 1) and refused(hip, sub, high + 1), (low, high)
    modes = [joint.read(0x6060, 0, "<b") for joint in joints]
    alive = Heartbeat(network)
    session = Session(network, joints, float(sys.argv[2]) if len(sys.argv) > 2 else 1.0)
    designed, half = limits[MOST_POSITION - 1], limits[MOST_POSITION - 1] // 2
    slower = limits[LEAST_CURRENT - 1]
    found = {}
    for position, current in ((0, 0), (half, 0), (half, slower), (0, slower)):
        found[position, current] = session.deviation(position, current)
        print(f"position loop {(position or designed) / 100:.1f} Hz, current loop"
              f" {current or limits[MOST_CURRENT - 1]} Hz: pushed {1e3 * found[position, current]:.1f} mrad"
              f" by {PUSH_NM:.0f} N m")
    for current in (0, slower):
        ratio = found[half, current] / found[0, current]
        print(f"current loop {current or limits[MOST_CURRENT - 1]} Hz: half the bandwidth of the position loop,"
              f" {ratio:.2f} times the deviation")
        assert 3.0 < ratio < 5.0, ratio
    for joint, mode in zip(joints, modes):
        assert set(joint.emergencies) <= {0, UNPLUGGED}, joint.emergencies
        joint.write(0x6060, 0, mode, "<b")
    alive.stop()
    # After their resets the nodes have the stored objects again, so nothing of a session is stored.
    for joint in joints:
        network.send_message(0, bytes([0x81, joint.number]))
    until("the reset", lambda: hip.read(0x2021, CURRENT, "<H") == 0)
    for sub, value in ((POSITION, half), (CURRENT, slower)):
        hip.write(0x2021, sub, value, "<H")
    save(hip)
    try:
        network.send_message(0, bytes([0x81, hip.number]))
        stored = lambda: [hip.read(0x2021, sub, "<H") for sub in (POSITION, CURRENT)]
        until("the stored bandwidths", lambda: stored() == [half, slower])
        print(f"after a reset of the node: {half / 100:.1f} Hz and {slower} Hz")
    finally:
        for sub in (POSITION, CURRENT):
            hip.write(0x2021, sub, 0, "<H")
        save(hip)
    network.disconnect()
    print("gains: ok")


if __name__ == "__main__":
    main()
