"""Hostile frames through the port: `hostile.py HOST:PORT [--frames N] [--taken N] [--pid PID]`.

Sends random frames of every identifier and length, broken lines and endless lines, as fast as the port takes
them. It sends at least `--frames` (a million), until `--taken` frames other than stops were accepted instead
of refused. Every line must be answered, and no more of these frames may be accepted than the bus carries;
stops are always accepted. The process `--pid` may grow by at most 32 MB, and the nodes must answer afterwards.
The last line is `hostile: ok`.
"""

import argparse
import collections
import random
import select
import socket
import time

CHUNK = 2000
# Shortest sent frame, bits; bit rate of the bus, bits per second.
SHORTEST, WIRE = 47, 1_000_000
MOST_GROWN_KB = 32_000
# Identifiers of frames that may be stops: NMT, controlwords, SDO requests.
STOPS = (b"t000", b"t201", b"t202", b"t601", b"t602")


def lines(dice):
    """Returns a chunk of random lines; each has one answer."""
    out = []
    for _ in range(CHUNK):
        kind = dice.random()
        if kind < 0.9:
            data = dice.randbytes(dice.randint(0, 8))
            identifier = dice.choice((dice.randint(0, 0x7FF), 0, 0x80, 0x201, 0x301, 0x601, 0x602))
            out.append(f"t{identifier:03X}{len(data)}{data.hex().upper()}")
        elif kind < 0.95:
            # Neither an adapter command nor one that closes or opens the channel.
            out.append("".join(dice.choice("tTrRx0123456789ABDE") for _ in range(dice.randint(1, 40))))
        else:
            out.append("t601" + "8" * dice.randint(1, 300))
    return [(line + "\r").encode() for line in out]


def memory_kb(pid):
    """Present memory of the process."""
    with open(f"/proc/{pid}/status", encoding="ascii") as status:
        return next(int(line.split()[1]) for line in status if line.startswith("VmRSS:"))


class Port:
    """The port and statistics of its answers."""

    def __init__(self, address):
        host, _, number = address.rpartition(":")
        self.socket = socket.create_connection((host, int(number)))
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.rest, self.taken, self.bells, self.frames = b"", 0, 0, []
        # Sent lines without an answer yet, and accepted frames that may be stops; answers come in order.
        self.sent, self.stops = collections.deque(), 0

    def read(self, wait_s):
        """Counts the available answers."""
        if not select.select([self.socket], [], [], wait_s)[0]:
            return
        received = self.socket.recv(1 << 18)
        if not received:
            raise SystemExit("the port closed the connection")
        *answers, self.rest = (self.rest + received).replace(b"\x07", b"\x07\r").split(b"\r")
        for line in answers:
            if line in (b"z", b"\x07") and self.sent:
                may_stop = self.sent.popleft()[:4] in STOPS
                self.stops += line == b"z" and may_stop
                self.taken += line == b"z" and not may_stop
            self.bells += line == b"\x07"
            if line[:1] == b"t":
                self.frames = self.frames[-99:] + [line]

    def send(self, data):
        """Reads while it sends, because the port may wait until its answers are read."""
        self.sent.extend(line + b"\r" for line in data.split(b"\r")[:-1] if line not in (b"C", b"S8", b"O"))
        while data:
            _, writable, _ = select.select([], [self.socket], [], 0)
            if writable:
                data = data[self.socket.send(data[:1 << 14]):]
            self.read(0 if writable else 0.01)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("address")
    parser.add_argument("--frames", type=int, default=1_000_000)
    parser.add_argument("--taken", type=int, default=0)
    parser.add_argument("--pid", type=int)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    dice = random.Random(arguments.seed)
    # A few chunks in random order, because making a million lines takes longer than sending them.
    chunks = [lines(dice) for _ in range(40)]
    port = Port(arguments.address)
    port.send(b"C\rS8\rO\r")
    before = memory_kb(arguments.pid) if arguments.pid else 0
    most, begin, sent, port.taken, port.bells = before, time.monotonic(), 0, 0, 0
    while sent < arguments.frames or port.taken < arguments.taken:
        port.send(b"".join(dice.choice(chunks)))
        sent += CHUNK
        if arguments.pid:
            most = max(most, memory_kb(arguments.pid))
    end = time.monotonic() + 60
    while port.sent:
        port.read(0.5)
        if time.monotonic() > end:
            raise SystemExit(f"{sent} lines, {len(port.sent)} without an answer")
    seconds = time.monotonic() - begin
    carries = (seconds + 0.2) * WIRE / SHORTEST
    print(f"{sent} lines sent ({arguments.frames} required) in {seconds:.1f} s: {port.taken} frames taken ({arguments.taken} required), "
          f"{port.stops} more that may be stops, {port.bells} refused; memory {before} KB, at most {most} KB")
    assert port.bells > 0 and port.taken <= carries + 0.02 * sent, f"{port.taken} taken, the wire carries {carries:.0f}"
    assert most - before < MOST_GROWN_KB, "the memory is not bounded"
    # All nodes restart and report it, whatever was written before.
    port.frames.clear()
    boots, end = set(), time.monotonic() + 60
    while len(boots) < 2:
        port.send(b"t00028100\r")
        port.read(0.2)
        boots |= {line for line in port.frames if line[:2] == b"t7" and line[4:] == b"100"}
        if time.monotonic() > end:
            raise SystemExit(f"after a reset of all nodes two boot-up messages are missing: {boots}")
        time.sleep(0.2)
    print("hostile: ok")


if __name__ == "__main__":
    main()
