"""An identification over the bus: `identify.py HOST:PORT [--json FILE] [--no-log] [--cancel]`.

Sets plan and seed, enables the leg, starts the identification and reads the 500 Hz log in blocks while the
leg moves. Then verdict, parameters with standard deviation and status, and fits are read. Lost samples end
the script with exit code 1. `--no-log` does not read the log, for a wire or a host that cannot carry it.
`--cancel` cancels while the leg moves.
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
RATE_HZ, TICKS_PER_SAMPLE = 500, 8


class Log:
    """The node's queue of samples: reads it in blocks and counts what was lost.

    The queue drops new samples while it is full; object 2140:4 counts them. It holds 2,000 samples in `serve`
    (4 s) and 192 on the board (0.38 s).
    """

    def __init__(self, joint):
        self.joint, self.samples, self.longest = joint, [], 0
        # Discards old samples unread: reading them would keep the queue full and lose new samples.
        joint.write(0x2140, 1, 1)
        joint.write(0x2140, 1, 0)
        self.lost_before = joint.read(0x2140, 4)

    def take(self):
        """Locks the waiting samples, reads them as one block, releases them."""
        self.joint.write(0x2140, 1, 1)
        held = self.joint.read(0x2140, 1)
        self.longest = max(self.longest, held)
        if held:
            with self.joint.node.sdo.open(0x2140, 2, "rb", block_transfer=True) as stream:
                self.samples.extend(SAMPLE.iter_unpack(stream.read()))
        self.joint.write(0x2140, 1, 0)

    def lost(self):
        """Samples that the node dropped since the start."""
        return self.joint.read(0x2140, 4) - self.lost_before

    def complaint(self, seconds):
        """Describes samples missing in a log of this time, by the node's count or by a gap in the ticks."""
        lost = self.lost()
        ticks = [sample[0] for sample in self.samples]
        gaps = [(one, other) for one, other in zip(ticks, ticks[1:]) if other - one != TICKS_PER_SAMPLE]
        if not lost and not gaps:
            return None
        where = f", first gap from tick {gaps[0][0]} to {gaps[0][1]}" if gaps else ""
        return (f"{lost} samples of the log lost, limit 0{where}. Read {len(ticks)} samples in {seconds:.0f} s, {RATE_HZ} are "
                f"produced in each second of the leg's time; up to {self.longest} waited. The host or the wire is too slow for the "
                "log (more than 250 kbit/s): free the host's processor, use a bit rate of 500 kbit/s, or identify with --no-log")


def parameters(joint):
    """Reads the fourteen parameters of each joint."""
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
    options.add_argument("--no-log", action="store_true")
    options.add_argument("--cancel", action="store_true")
    options = options.parse_args()
    network = connect(options.address)
    hip, knee = joints = [Joint(network, number) for number in (1, 2)]
    network.nmt.state = "OPERATIONAL"
    enable(joints)
    hip.write(0x2100, 4, 0, "<B")
    hip.write(0x2100, 5, options.seed & 0xFFFFFFFF)
    hip.write(0x2100, 6, options.seed >> 32)
    log, begin, complaint = None if options.no_log else Log(hip), time.monotonic(), None
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
        if log:
            log.take()
        if time.monotonic() > end:
            raise SystemExit("identify: no verdict after 300 s")
    if log:
        log.take()
        complaint = log.complaint(time.monotonic() - begin)
    verdict = hip.read(0x2100, 8, "<B")
    if options.cancel:
        assert verdict == 0 and all(joint.state() == 0x27 for joint in joints)
        if complaint:
            raise SystemExit(f"identify: {complaint}")
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
    }
    print(" ".join([report["verdict"], *report["reasons"]]))
    if log:
        report["log"] = log.samples
        training = sum(sample[1] == 1 for sample in log.samples)
        print(f"log: {len(log.samples)} samples, {training} of the training motion, up to {log.longest} waited")
    for name, found in zip(("hip", "knee"), report["parameters"]):
        for symbol, one in found.items():
            print(f"{name:5}{symbol:4}{one['value']}  +- {one['sigma']}  {one['status']}")
    if options.json:
        with open(options.json, "w") as file:
            json.dump(report, file)
    for joint in joints:
        joint.write(0x6040, 0, 0x00, "<H")
    until("off", lambda: hip.state() == 0x40)
    if complaint:
        raise SystemExit(f"identify: {complaint}")
    # Stores the model and all settings permanently.
    hip.emergencies.clear()
    hip.write(0x1010, 1, int.from_bytes(b"save", "little"))
    until("how the store ended", lambda: hip.emergencies[-1:] in ([0x0000], [0x5530]))
    assert hip.emergencies == [0xFF0D, 0x0000], hip.emergencies
    print("stored generation:", hip.read(0x2100, 7))
    assert hip.read(0x2100, 7) > 0
    network.disconnect()
    print("identify: ok")


if __name__ == "__main__":
    main()
