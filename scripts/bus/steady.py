"""A host at 500 Hz for a long time: `steady.py HOST:PORT SECONDS REPORTS`; REPORTS holds the output of `serve`.

Sends SYNC and both joints' targets every 2 ms (compact mapping, mode 8); both nodes answer every SYNC.
Measures the round trip and the delay of this process itself. Fails if an answer is later than the delays of
`serve` and this process explain, or if the nodes stop answering. Also fails if the leg is stopped for a lost
host although no gap reached a timeout, or for any other reason. The last line is `steady: ok`.
"""

import math
import select
import socket
import struct
import sys
import time

NODES = (1, 2)
PERIOD_S = 0.002
# `serve` reports delays above 10 ms. The rest covers the bus and the time between two of its clock readings.
UNREPORTED_S, MARGIN_S = 0.010, 0.005
# Shortest timeout of a silent host.
WATCHDOG_S = 0.1
# Emergency codes of a lost host.
LOST = {0x8110, 0x8120, 0x8130, 0x8140, 0x8250, 0xFF0F}
WAY, RATE_HZ = 50_000, 0.2
OFF = 1 << 31


class Port:
    """slcan without a thread."""

    def __init__(self, address):
        host, _, number = address.rpartition(":")
        self.socket = socket.create_connection((host, int(number)))
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.rest = b""
        self.socket.sendall(b"C\rS8\rO\r")

    def send(self, *frames):
        """Sends frames at once."""
        lines = (f"t{identifier:03X}{len(data)}{data.hex().upper()}\r" for identifier, data in frames)
        self.socket.sendall("".join(lines).encode())

    def read(self, wait_s):
        """Returns received frames after at most this time, with None for each error (BEL)."""
        if not select.select([self.socket], [], [], wait_s)[0]:
            return []
        received = self.socket.recv(1 << 16)
        if not received:
            raise SystemExit("serve closed the connection")
        *lines, self.rest = (self.rest + received).replace(b"\x07", b"\x07\r").split(b"\r")
        return [(int(line[1:4], 16), bytes.fromhex(line[5:].decode())) for line in lines
                if line[:1] == b"t"] + [None for line in lines if line == b"\x07"]

    def ask(self, node, request):
        """One SDO request and its answer."""
        for _ in range(5):
            self.send((0x600 + node, request))
            end = time.monotonic() + 2
            while time.monotonic() < end:
                for frame in self.read(0.1):
                    if frame and frame[0] == 0x580 + node and frame[1][1:4] == request[1:4]:
                        return frame[1]
        raise SystemExit(f"node {node} does not answer")

    def write(self, node, index, sub, value, size):
        """Writes an object of at most four bytes."""
        request = struct.pack("<BHBI", 0x23 | (4 - size) << 2, index, sub, value & 0xFFFFFFFF)
        answer = self.ask(node, request)
        assert answer[0] == 0x60, f"node {node}, {index:04X}:{sub}: {answer.hex()}"

    def value(self, node, index, sub=0):
        """Reads a number."""
        return struct.unpack("<i", self.ask(node, struct.pack("<BHBI", 0x40, index, sub, 0))[4:])[0]


def set_up(port):
    """Configures the compact cycle."""
    port.send((0, b"\x01\x00"))
    for node in NODES:
        for place in (1, 2, 3):
            port.write(node, 0x1800 + place, 1, OFF | 0x180 + 0x100 * place + node, 4)
        targets = [0x00070020] * 2
        targets[node - 1] = 0x607A0020
        for base, cob, objects in ((0x1800, 0x180 + node, [0x60410010, 0x60640020, 0x20100010]), (0x1401, 0x301, targets)):
            port.write(node, base, 1, OFF | cob, 4)
            port.write(node, base + 0x200, 0, 0, 1)
            port.write(node, base, 2, 1, 1)
            for place, entry in enumerate(objects, 1):
                port.write(node, base + 0x200, place, entry, 4)
            port.write(node, base + 0x200, 0, len(objects), 1)
            port.write(node, base, 1, cob, 4)
        port.write(node, 0x60C2, 1, 2, 1)
        # The following-error timeout tolerates a host that is not real-time.
        port.write(node, 0x6066, 0, 1000, 2)


def enable(port):
    """Sends 6, 7, F with targets at the joints' positions, and returns these."""
    for node in NODES:
        port.write(node, 0x6060, 0, 0, 1)
        port.write(node, 0x6040, 0, 0x80, 2)
        port.write(node, 0x6040, 0, 0, 2)
    for node in NODES:
        # A word that is sent while a stop lasts is refused (FF0E, reason 23).
        end = time.monotonic() + 10
        while port.value(node, 0x6041) & 0x6F == 0x07 and time.monotonic() < end:
            time.sleep(0.02)
    for word, state in ((6, 0x21), (7, 0x23), (15, 0x27)):
        for node in NODES:
            port.write(node, 0x6040, 0, word, 2)
        for node in NODES:
            end = time.monotonic() + 10
            while port.value(node, 0x6041) & 0x806F != state:
                if time.monotonic() > end:
                    raise SystemExit(f"node {node} does not reach {state:02X}")
    places = [port.value(node, 0x6064) for node in NODES]
    for node, place in zip(NODES, places):
        port.write(node, 0x607A, 0, place, 4)
        port.write(node, 0x6060, 0, 8, 1)
    return places


def emergency(frames):
    """Node and code of the emergency messages among these frames, except those that end an error."""
    found = [(frame[0] - 0x80, struct.unpack_from("<H", frame[1])[0]) for frame in frames
            if frame and 0x81 <= frame[0] < 0x100]
    return [(node, code) for node, code in found if code]


class Second:
    """Statistics of one second."""

    def __init__(self):
        self.trip, self.own, self.gap, self.bells, self.missing = 0.0, 0.0, 0.0, 0, 0


class Reports:
    """Reads new reports of `serve`: whether there were any, and the largest delay."""

    def __init__(self, path):
        self.file = open(path, encoding="utf-8")
        self.file.seek(0, 2)

    def late_s(self):
        late = None
        for line in self.file:
            if "ms late" in line:
                late = max(late or 0.0, float(line.split(" ms late")[0].split()[-1]) * 1e-3)
            elif line.startswith("last second"):
                late = max(late or 0.0, 0.0)
        return late


def main(address, seconds, path):
    port, reports = Port(address), Reports(path)
    set_up(port)
    places = enable(port)
    begin = time.monotonic()
    trips, found, stops, now, number = [], [], [], Second(), 0
    emergencies, waiting, sent, last = [], {}, begin, begin
    due, next_second = begin + PERIOD_S, begin + 1
    while (clock := time.monotonic()) - begin < seconds:
        if clock >= due:
            now.own = max(now.own, clock - due)
            now.gap = max(now.gap, clock - sent)
            offset = round(WAY * (1 - math.cos(2 * math.pi * RATE_HZ * (clock - begin))))
            port.send((0x80, b""), (0x301, struct.pack("<ii", *(place + offset for place in places))))
            # A SYNC that is unanswered at the next one counts until its answer.
            for node in NODES:
                waiting.setdefault(node, clock)
            sent, due = clock, max(due + PERIOD_S, clock)
            number += 1
        frames = port.read(max(0.0, min(due - time.monotonic(), PERIOD_S)))
        clock = time.monotonic()
        now.own = max(now.own, clock - last - PERIOD_S)
        last = clock
        word = 0x27
        for frame in frames:
            if frame is None:
                now.bells += 1
                continue
            identifier, data = frame
            if identifier in (0x181, 0x182):
                asked = waiting.pop(identifier - 0x180, None)
                if asked is not None:
                    trips.append(clock - asked)
                    now.trip = max(now.trip, clock - asked)
                state = struct.unpack_from("<H", data)[0] & 0x6F
                word = state if state != 0x27 else word
        emergencies += emergency(frames)
        for node, asked in list(waiting.items()):
            if clock - asked > 5:
                raise SystemExit(f"node {node} has not answered for 5 s, without an emergency")
        # After a lost host the nodes are pre-operational (object 1029) and send no statusword.
        if word != 0x27 or emergencies:
            end = time.monotonic() + 0.3
            while time.monotonic() < end:
                emergencies += emergency(port.read(0.02))
            longest = max([second.gap for second, _ in found[-3:]] + [now.gap])
            codes = ", ".join(f"node {node}: {code:04X}" for node, code in emergencies) or "no emergency"
            is_lost = bool(emergencies) and all(code in LOST for _, code in emergencies)
            print(f"after {clock - begin:.0f} s: state {word:02X}, {codes}; longest gap of this process {longest * 1e3:.0f} ms", flush=True)
            stops.append((is_lost and longest >= 0.9 * WATCHDOG_S, clock - begin))
            emergencies = []
            port.send((0, b"\x01\x00"))
            places = enable(port)
            # Discards the measurements of the set-up.
            now, begin_again = Second(), time.monotonic()
            waiting.clear()
            sent, last, due = begin_again, begin_again, begin_again + PERIOD_S
        if clock >= next_second:
            found.append((now, reports.late_s()))
            now, next_second = Second(), next_second + 1
            if len(found) % 60 == 0:
                print(f"{len(found)} s: {number} cycles, longest round trip of the minute {max(s.trip for s, _ in found[-60:]) * 1e3:.1f} ms, "
                      f"own delay {max(s.own for s, _ in found[-60:]) * 1e3:.1f} ms, seconds with a report {sum(r is not None for _, r in found[-60:])}",
                      flush=True)
    time.sleep(1.5)
    found.append((now, reports.late_s()))
    for node in NODES:
        port.write(node, 0x6040, 0, 0, 2)
    unexplained = []
    for place, (second, _) in enumerate(found):
        # The seconds of `serve` and of this process are not aligned.
        near = found[max(0, place - 1):place + 3]
        allowed = max([UNREPORTED_S] + [late for _, late in near if late is not None]) + 2 * max(s.own for s, _ in near) + MARGIN_S
        if second.trip > allowed:
            unexplained.append(f"second {place}: {second.trip * 1e3:.1f} ms, reported and caused {allowed * 1e3:.1f} ms")
    trips.sort()
    false_alarms = [when for has_cause, when in stops if not has_cause]
    print(f"{number} cycles in {seconds:.0f} s; round trip: half {trips[len(trips) // 2] * 1e3:.2f} ms, "
          f"99.9 % {trips[len(trips) * 999 // 1000] * 1e3:.2f} ms, longest {trips[-1] * 1e3:.1f} ms; "
          f"seconds with a report: {sum(late is not None for _, late in found)}; bells: {sum(s.bells for s, _ in found)}; "
          f"stops: {len(stops)}, of them not for a gap of this process: {len(false_alarms)}; later than reported: {len(unexplained)}")
    for line in unexplained[:20]:
        print(line)
    if unexplained or false_alarms or emergencies:
        raise SystemExit(f"steady: failed {emergencies}")
    print("steady: ok")


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]), sys.argv[3])
