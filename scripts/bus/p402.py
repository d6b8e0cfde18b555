"""Drive profile by `canopen.BaseNode402`: `p402.py HOST:PORT FOLDER`; `cargo sim eds --out FOLDER` first.

Both joints go to OPERATION ENABLED, profile velocity, profile position, off. TPDO 1 contains the statusword
and is sent every 20 ms, because the library waits for it before each step. The last line is `p402: ok`.
"""

import os
import sys
import time

import canopen

from scarab_bus import MICRO, connect, until

JOINTS = ((1, "hip"), (2, "knee"))
EVENT_DRIVEN, PERIOD_MS = 255, 20
SPEED, WAY = 0.1, 0.1
NEW_SET_POINT, AT_ONCE = 1 << 4, 1 << 5
ENABLED = 0x0F


def set_up(network, number, sheet):
    """Creates a node from its sheet, with a statusword every 20 ms."""
    node = canopen.BaseNode402(number, sheet)
    network.add_node(node)
    # On a busy machine `serve` drops a controlword that waited for more than 100 ms, so it is sent again.
    node.sdo.RESPONSE_TIMEOUT, node.sdo.MAX_RETRIES = 2.0, 3
    node.nmt.state = "PRE-OPERATIONAL"
    node.tpdo.read()
    node.rpdo.read()
    node.tpdo[1].trans_type = EVENT_DRIVEN
    node.tpdo[1].event_timer = PERIOD_MS
    node.tpdo[1].save()
    node.nmt.state = "OPERATIONAL"
    node.setup_402_state_machine()
    return node


def position(node):
    """Flexion, rad."""
    return node.sdo[0x6064].raw * MICRO


def profile_velocity(node):
    """Commands 0.1 rad/s until it is reached, then rest."""
    node.op_mode = "PROFILED VELOCITY"
    assert node.op_mode == "PROFILED VELOCITY", node.op_mode
    begin = position(node)
    node.sdo[0x60FF].raw = round(SPEED / MICRO)
    until("0.1 rad/s", lambda: abs(node.sdo[0x606C].raw * MICRO - SPEED) < 0.04)
    until("0.05 rad", lambda: position(node) - begin > 0.05)
    node.sdo[0x60FF].raw = 0
    until("rest", lambda: abs(node.sdo[0x606C].raw * MICRO) < 0.02)
    print(f"profile velocity: from {begin:.3f} to {position(node):.3f} rad")


def profile_position(node):
    """Commands a set-point of 0.1 rad less."""
    node.op_mode = "PROFILED POSITION"
    assert node.op_mode == "PROFILED POSITION", node.op_mode
    goal = position(node) - WAY
    node.sdo[0x6081].raw = 500_000
    node.sdo[0x607A].raw = round(goal / MICRO)
    node.controlword = ENABLED | NEW_SET_POINT | AT_ONCE
    until("set-point taken", lambda: node.statusword & 1 << 12)
    node.controlword = ENABLED
    # The previous target is reported as reached until the leg has taken this one.
    time.sleep(0.1)
    until("target reached", lambda: node.statusword & 1 << 10 and not node.statusword & 1 << 12)
    assert abs(position(node) - goal) < 0.02, f"{position(node)} instead of {goal}"
    print(f"profile position: reached {goal:.3f} rad")


def main():
    address, folder = sys.argv[1:3]
    network = connect(address)
    nodes = [set_up(network, number, os.path.join(folder, f"scarab-{joint}.eds")) for number, joint in JOINTS]
    for node in nodes:
        # The library assumes a statusword of 0 until it has received a PDO. It knows that the PDO is periodic only
        # after the second one; until then its `check_statusword` does not wait.
        until("switch on disabled", lambda: node.state == "SWITCH ON DISABLED")
    for node in nodes:
        node.state = "OPERATION ENABLED"
    # Bit 15: the other joint has not requested enabling yet.
    until("the leg's drive", lambda: not any(node.statusword & 1 << 15 for node in nodes))
    print("enabled by the library's state machine:", ", ".join(node.state for node in nodes))
    profile_velocity(nodes[0])
    profile_position(nodes[0])
    for node in nodes:
        node.state = "SWITCH ON DISABLED"
    for node in nodes:
        until("off", lambda: node.state == "SWITCH ON DISABLED")
    network.disconnect()
    print("p402: ok")


if __name__ == "__main__":
    main()
