"""An identification over the bus: `identify.py HOST:PORT [--json FILE]`.

Plan and seed are set, the leg is enabled, the identification is begun, the 500 Hz log is taken away in blocks meanwhile; then verdict,
parameters with standard deviation and status, and fits are read. `--cancel` gives it up while it moves.
"""

import argparse
import json
import struct
import time

from scarab_bus import Joint, connect, enable, known, until

SYMBOLS = "XX XY XZ YY YZ ZZ HX HY HZ M IA FC FV OFF".split()
STATUS = [None, "identified", "grouped", "weak", "prior"]
REASONS = "unphysical unexcited residual validation not_a_measurement outliers contact input".split()
STATES = "idle approach excite settle solve validate_approach validate judge track follow".split()
START, CANCEL = 1, 2
SAMPLE = struct.Struct("<II2f2f")


def take_log(joint, samples):
    """Holds what waits, reads it as a block, lets it go."""
    joint.write(0x2140, 1, 1)
    if joint.read(0x2140, 1):
        with joint.node.sdo.open(0x2140, 2, "rb", block_transfer=True) as stream:
            block = stream.read()
        samples.extend(SAMPLE.iter_unpack(block))
    joint.write(0x2140, 1, 0)


def parameters(joint):
    """Fourteen of each joint."""
    return {
        symbol: {
            "value": known(joint.read(0x2110, place, "<f")),
            "sigma": known(joint.read(0x2111, place, "<f")),
            "status": STATUS[joint.read(0x2112, place, "<B")],
        }
        for place, symbol in enumerate(SYMBOLS, 1)
    }


def base_parameters(joint):
    found = []
    for place in range(1, 14):
        carrier, flags = joint.read(0x2122, place, "<H"), joint.read(0x2123, place, "<B")
        if carrier:
            found.append({
                "joint": carrier >> 8,
                "symbol": SYMBOLS[(carrier & 0xFF) - 1],
                "value": known(joint.read(0x2120, place, "<f")),
                "sigma": known(joint.read(0x2121, place, "<f")),
                "least_squares": known(joint.read(0x2124, place, "<f")),
                "grouped": bool(flags & 2),
                "dropped": bool(flags & 4),
            })
    return found


def fits(joint):
    return [
        {
            "rms_nm": known(joint.read(0x2130, motion, "<f")),
            "mean_abs_nm": known(joint.read(0x2131, motion, "<f")),
            "torque_rms_nm": known(joint.read(0x2132, motion, "<f")),
            "rows": joint.read(0x2133, motion),
        }
        for motion in range(1, 5)
    ]


def main():
    options = argparse.ArgumentParser()
    options.add_argument("address")
    options.add_argument("--json")
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--cancel", action="store_true")
    options = options.parse_args()
    network = connect(options.address)
    hip, knee = joints = [Joint(network, number) for number in (1, 2)]
    network.nmt.state = "OPERATIONAL"
    enable(joints)
    hip.write(0x2100, 4, 0, "<B")
    hip.write(0x2100, 5, options.seed & 0xFFFFFFFF)
    hip.write(0x2100, 6, options.seed >> 32)
    samples, lost = [], hip.read(0x2140, 4)
    take_log(hip, [])
    hip.write(0x2100, 1, START, "<B")
    until("the identification to begin", lambda: 1 <= hip.read(0x2100, 2, "<B") <= 7)
    state, end = None, time.monotonic() + 300
    while True:
        now = hip.read(0x2100, 2, "<B")
        if now != state:
            print("state:", STATES[now])
        state = now
        if options.cancel and state == 2:
            hip.write(0x2100, 1, CANCEL, "<B")
        if not 1 <= state <= 7:
            break
        take_log(hip, samples)
        if time.monotonic() > end:
            raise SystemExit("without end")
    lost = hip.read(0x2140, 4) - lost
    verdict = hip.read(0x2100, 8, "<B")
    if options.cancel:
        assert verdict == 0 and all(joint.state() == 0x27 for joint in joints)
        print("identify: cancelled, the leg is at rest and enabled")
        return
    bits = hip.read(0x2100, 9, "<B")
    report = {
        "verdict": ["none", "accepted", "refused"][verdict],
        "reasons": [reason for place, reason in enumerate(REASONS) if bits >> place & 1],
        "seed": hip.read(0x2100, 5) | hip.read(0x2100, 6) << 32,
        "iterations": hip.read(0x2100, 10),
        "evaluations": hip.read(0x2100, 11),
        "parameters": [parameters(joint) for joint in joints],
        "base": base_parameters(hip),
        "fits": [fits(joint) for joint in joints],
        "samples": len(samples),
        "samples_lost": lost,
    }
    training = [sample for sample in samples if sample[1] == 1]
    print(f"{report['verdict']} {' '.join(report['reasons'])}; {len(samples)} samples of the log, {len(training)} of the "
          f"motion identified from, {lost} lost")
    for name, found in zip(("hip", "knee"), report["parameters"]):
        for symbol, one in found.items():
            print(f"{name:5}{symbol:4}{one['value']}  +- {one['sigma']}  {one['status']}")
    if options.json:
        with open(options.json, "w") as file:
            json.dump({**report, "log": samples}, file)
    for joint in joints:
        joint.write(0x6040, 0, 0x00, "<H")
    until("off", lambda: hip.state() == 0x40)
    # The model and everything that was set up, kept over the power.
    hip.emergencies.clear()
    hip.write(0x1010, 1, int.from_bytes(b"save", "little"))
    until("how the store ended", lambda: hip.emergencies[-1:] in ([0x0000], [0x5530]))
    assert hip.emergencies == [0xFF0D, 0x0000], hip.emergencies
    print("generation kept:", hip.read(0x2100, 7))
    assert hip.read(0x2100, 7) > 0
    network.disconnect()
    print("identify: ok")


if __name__ == "__main__":
    main()
