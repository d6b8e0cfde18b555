"""Drive profile by `canopen.BaseNode402`: `p402.py HOST:PORT FOLDER`; `cargo sim eds --out FOLDER` first.

Runs the code of docs/hosts/python-canopen.md, which enables both joints and commands a velocity. Then checks
that velocity, profile position and off. The last line is `p402: ok`.
"""

import os
import re
import sys
import time

from scarab_bus import MICRO, until

PAGE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../docs/hosts/python-canopen.md")
PLACEHOLDER = "127.0.0.1:PORT"
SPEED, WAY = 0.1, 0.1
NEW_SET_POINT, AT_ONCE = 1 << 4, 1 << 5
ENABLED = 0x0F


def page_code():
    """Code of the page for host programmers."""
    with open(PAGE, encoding="utf-8") as page:
        blocks = re.findall(r"^```python\n(.*?)^```$", page.read(), re.MULTILINE | re.DOTALL)
    assert len(blocks) == 1, f"{PAGE}: {len(blocks)} blocks of Python"
    return blocks[0]


def run_page(address, folder):
    """Runs the page's code at this address, in the folder of the sheets. Returns its network and nodes."""
    code = page_code()
    assert code.count(PLACEHOLDER) == 1, f"{PAGE}: no {PLACEHOLDER}"
    names = {}
    os.chdir(folder)
    exec(compile(code.replace(PLACEHOLDER, address), PAGE, "exec"), names)
    return names["network"], names["nodes"]


def position(node):
    """Flexion, rad."""
    return node.sdo[0x6064].raw * MICRO


def profile_velocity(node):
    """Awaits the 0.1 rad/s that the page's code has commanded, then commands rest."""
    assert node.op_mode == "PROFILED VELOCITY", node.op_mode
    begin = position(node)
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
    network, nodes = run_page(address, folder)
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
