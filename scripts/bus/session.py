"""A host's session with a leg, like that of recorded host software: `session.py HOST:PORT [NODE NODE]`.

Network start, PDOs configured while Operational, 6 7 F, motions by received PDOs of type 255 and of type 1
with SYNC, two kinds of a lost host, and recovery. Every step is checked; the last line is `session: ok`.
"""

import math
import struct
import sys
import time

from scarab_bus import HOST, Heartbeat, Joint, MICRO, connect, enable, send_until, until

# Emergency: the host was silent for 100 ms, and attempts of a motion that this machine may disturb so.
HOST_SILENT, ATTEMPTS = 0xFF0F, 5


class HostSilent(Exception):
    """The nodes report that this host fell silent."""


def set_up(joint):
    """Configures RPDO and TPDO as in the recorded session."""
    node = joint.number
    joint.set_up_pdo(0x1800, 0x180 + node, 1, [0x60410010])
    joint.set_up_pdo(0x1801, 0x280 + node, 1, [0x60640020, 0x606C0020])
    joint.set_up_pdo(0x1802, 0x380 + node, 1, [0x60770010])
    joint.set_up_pdo(0x1803, 0x480 + node, 1, [0x219A0020])
    joint.set_up_pdo(0x1400, 0x200 + node, 0xFF, [0x60400010])
    joint.set_up_pdo(0x1401, 0x300 + node, 0xFF, [0x607A0020])
    joint.set_up_pdo(0x1402, 0x400 + node, 0xFF, [0x60FF0020])
    joint.set_up_pdo(0x1403, 0x500 + node, 0xFF, [0x60710010])


def sync(network, joints, position):
    """Sends SYNC and returns the received positions; the statusword must be received too."""
    for joint in joints:
        joint.sent.clear()

    def is_answered():
        if any(HOST_SILENT in joint.emergencies for joint in joints):
            raise HostSilent
        return all(len(joint.sent) == 4 for joint in joints)

    send_until("the PDOs after SYNC", lambda: network.send_message(0x80, b""), is_answered)
    if position:
        return [joint.pdo(0x1801, "<ii")[0] * MICRO for joint in joints]
    return [joint.pdo(0x1800, "<H")[0] for joint in joints]


def profile_position(network, joints):
    """Commands a set-point by PDO of type 255: target, then bit 4."""
    for joint in joints:
        joint.write(0x6060, 0, 1, "<b")
        until("mode 1", lambda: joint.read(0x6061, 0, "<b") == 1)
        joint.write(0x6081, 0, 500_000)
    begin = sync(network, joints, True)
    goals = [place + 0.15 for place in begin]

    def send():
        for joint, goal in zip(joints, goals):
            network.send_message(0x300 + joint.number, struct.pack("<i", round(goal / MICRO)))
            for word in (0x2F, 0x3F):
                network.send_message(0x200 + joint.number, struct.pack("<H", word))

    send_until("acknowledged set-points", send, lambda: all(joint.read(0x6041, 0, "<H") & 1 << 12 for joint in joints))
    # The previous target is reported as reached until the leg has taken this one.
    time.sleep(0.05)
    for joint in joints:
        until("target reached", lambda: joint.read(0x6041, 0, "<H") & 1 << 10)
        network.send_message(0x200 + joint.number, struct.pack("<H", 0x2F))
    for place, goal in zip(sync(network, joints, True), goals):
        assert abs(place - goal) < 0.02, f"{place} instead of {goal}"
    print("profile position: reached", ", ".join(f"{goal:.3f} rad" for goal in goals))


def profile_velocity(network, joints):
    """Commands a velocity by PDO, then halt."""
    joint = joints[0]
    joint.write(0x6060, 0, 3, "<b")

    def velocity(micro_rad):
        network.send_message(0x400 + joint.number, struct.pack("<i", micro_rad))

    def word(value):
        network.send_message(0x200 + joint.number, struct.pack("<H", value))

    send_until("0.2 rad/s", lambda: velocity(-200_000), lambda: abs(joint.read(0x606C, 0, "<i") + 200_000) < 40_000)
    send_until("halt", lambda: word(0x10F),
               lambda: joint.read(0x6041, 0, "<H") & 1 << 10 and abs(joint.read(0x606C, 0, "<i")) < 20_000)
    send_until("velocity 0", lambda: velocity(0), lambda: joint.read(0x60FF, 0, "<i") == 0)
    send_until("the end of halt", lambda: word(0x0F), lambda: joint.read(0x6040, 0, "<H") == 0x0F)
    print("profile velocity: followed and halted")


def cyclic_position(network, joints):
    """Repeats the cyclic motion if this machine paused for 100 ms, which the nodes must report as a silent host."""
    for joint in joints:
        joint.set_up_pdo(0x1401, 0x300 + joint.number, 1, [0x607A0020])
        joint.write(0x60C2, 1, 10, "<B")
        # This host is not real-time.
        joint.write(0x6066, 0, 1000, "<H")
    for _ in range(ATTEMPTS):
        try:
            return cyclic_motion(network, joints)
        except HostSilent:
            print("cyclic position: this machine paused, the nodes report a silent host; again")
        for joint in joints:
            joint.emergencies.clear()
        network.nmt.state = "OPERATIONAL"
        enable(joints)
    raise SystemExit(f"cyclic position: a silent host in {ATTEMPTS} of {ATTEMPTS} attempts")


def cyclic_motion(network, joints, seconds=3.0, period_s=0.01):
    """Commands positions by PDO of type 1, taken at SYNC, every 10 ms as far as this machine can."""
    begin = [joint.position() for joint in joints]
    for joint, place in zip(joints, begin):
        joint.write(0x607A, 0, round(place / MICRO), "<i")
        joint.write(0x6060, 0, 8, "<b")
    largest, start = 0.0, time.monotonic()
    while (now := time.monotonic() - start) < seconds:
        offset = 0.05 * (1 - math.cos(2 * math.pi * now / seconds))
        for joint, place in zip(joints, begin):
            network.send_message(0x300 + joint.number, struct.pack("<i", round((place + offset) / MICRO)))
        places = sync(network, joints, True)
        largest = max(largest, *(abs(place - first - offset) for place, first in zip(places, begin)))
        time.sleep(max(0.0, start + now + period_s - time.monotonic()))
    for word in sync(network, joints, False):
        assert word & 0x6F == 0x27, f"statusword {word:04X}"
    # The joint lags by a period and the servo, and this machine may be late.
    assert largest < 0.06, f"{largest} rad behind"
    print(f"cyclic position: {seconds:.0f} s under SYNC, at most {largest * 1e3:.1f} mrad from the newest target")


def lose_the_host(network, joints):
    """Without the heartbeat the leg stops according to 6007, sends an emergency message and stays off."""
    for option, final in ((3, 0x40), (1, 0x08)):
        for joint in joints:
            joint.write(0x6060, 0, 0, "<b")
        enable(joints)
        heartbeat = Heartbeat(network)
        for joint in joints:
            joint.write(0x6007, 0, option, "<h")
            assert joint.read(0x1016, 1) == 0, "another host watches this leg"
            joint.write(0x1016, 1, HOST << 16 | 1000)
            joint.emergencies.clear()
        time.sleep(0.5)
        assert all(joint.state() == 0x27 for joint in joints)
        heartbeat.stop()
        for joint in joints:
            until("emergency 8130", lambda: 0x8130 in joint.emergencies)
            until(f"state {final:02X}", lambda: joint.state() == final)
            # 1029:1 is 0: Pre-operational.
            joint.write(0x1016, 1, 0)
        network.nmt.state = "OPERATIONAL"
        for joint in joints:
            if final == 0x08:
                joint.write(0x6040, 0, 0x80, "<H")
            joint.write(0x6040, 0, 0x00, "<H")
        for joint in joints:
            until("switch on disabled", lambda: joint.state() == 0x40)
        print(f"host lost, 6007 is {option}: emergency 8130, state {final:02X}, and back")


def main(address, numbers):
    network = connect(address)
    joints = [Joint(network, number) for number in numbers]
    # Started before configuration, in the order of the recorded host software.
    network.nmt.state = "OPERATIONAL"
    for joint in joints:
        set_up(joint)
        assert joint.read(0x1000) == 0x00020192
    assert all(word & 0x6F == 0x40 for word in sync(network, joints, False))
    enable(joints)
    print("enabled by 6, 7, F")
    profile_position(network, joints)
    profile_velocity(network, joints)
    cyclic_position(network, joints)
    for joint in joints:
        joint.write(0x6040, 0, 0x02, "<H")
    for joint in joints:
        until("off after quick stop", lambda: joint.state() == 0x40)
        joint.write(0x6040, 0, 0x00, "<H")
    print("quick stop: damped, then off")
    lose_the_host(network, joints)
    network.disconnect()
    print("session: ok")


if __name__ == "__main__":
    main(sys.argv[1], [int(number) for number in sys.argv[2:]] or [1, 2])
