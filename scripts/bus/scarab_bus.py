"""A leg on the bus, for Python: common code of `session.py` and `identify.py`.

Requires the packages `canopen`, `python-can` and `pyserial`. Any CAN adapter of python-can works; here it is
the one that `cargo sim serve` simulates.
"""

import math
import select
import struct
import threading
import time

import can
import canopen
from can.interfaces.slcan import slcanBus

HOST = 80
MICRO = 1e-6
PDO_OFF = 0x80000000


class Adapter(slcanBus):
    """python-can's slcan adapter on TCP, read in blocks.

    python-can reads a socket byte by byte, with a `select` and a `recv` for each of the 22 bytes of a frame.
    That takes three quarters of a core for the 500 Hz log. On a busy machine it falls behind and samples are
    lost.
    """

    def _read(self, timeout):
        port = self.serialPortOrig._socket
        while (end := self._buffer.find(self._OK)) < 0:
            if not select.select([port], [], [], timeout)[0]:
                return None
            received = port.recv(1 << 16)
            if not received:
                raise can.CanOperationError("the adapter closed the connection")
            self._buffer += received.replace(self._ERROR, self._ERROR + self._OK)
        line = self._buffer[:end + 1].decode()
        del self._buffer[:end + 1]
        return line


def connect(address):
    """Connects to the bus of an slcan adapter on TCP, `host:port`."""
    network = canopen.Network(Adapter(f"socket://{address}", bitrate=1_000_000, sleep_after_open=0))
    network.connect()
    return network


def holds(condition, longest_s):
    """Waits for a condition and returns its value, which is false after this time.

    The clock is read before the condition, because a busy machine may suspend this process in between.
    """
    end = time.monotonic() + longest_s
    while True:
        is_last = time.monotonic() > end
        value = condition()
        if value or is_last:
            return value
        time.sleep(0.002)


def until(what, condition, longest_s=60.0):
    """Waits for a condition and returns its value."""
    value = holds(condition, longest_s)
    if not value:
        raise SystemExit(f"waited {longest_s} s for: {what}")
    return value


def send_until(what, send, condition, longest_s=60.0):
    """Sends, and sends again every second, until a condition holds.

    On a busy machine `serve` drops SYNC and PDOs that waited for more than 100 ms; no answer shows it.
    """
    end = time.monotonic() + longest_s
    while time.monotonic() < end:
        send()
        if holds(condition, 1.0):
            return
    raise SystemExit(f"waited {longest_s} s for: {what}")


class Joint:
    """A node of the bus by its number, without a data sheet."""

    def __init__(self, network, number):
        self.network, self.number = network, number
        self.node = network.add_node(number, canopen.ObjectDictionary())
        self.node.sdo.RESPONSE_TIMEOUT = 5.0
        # On a busy machine `serve` drops a controlword that waited for more than 100 ms, so it is sent again.
        self.node.sdo.MAX_RETRIES = 3
        self.sent = {}
        self.emergencies = []
        self.node.emcy.add_callback(lambda error: self.emergencies.append(error.code))

    def read(self, index, sub=0, kind="<I"):
        """Reads an object as a number."""
        return struct.unpack(kind, self.node.sdo.upload(index, sub))[0]

    def write(self, index, sub, value, kind="<I"):
        """Writes a number to an object."""
        self.node.sdo.download(index, sub, struct.pack(kind, value))

    def set_up_pdo(self, communication, cob, kind, objects):
        """Maps a PDO like recorded host software: off, mapping, on; every write is acknowledged."""
        mapping = communication + 0x200
        self.write(communication, 1, PDO_OFF | cob)
        self.write(mapping, 0, 0, "<B")
        self.write(communication, 2, kind, "<B")
        for place, entry in enumerate(objects, 1):
            self.write(mapping, place, entry)
        self.write(mapping, 0, len(objects), "<B")
        self.write(communication, 1, cob)
        if communication >= 0x1800:
            self.network.subscribe(cob, lambda _, data, when: self.sent.__setitem__(communication, (bytes(data), when)))

    def pdo(self, communication, kind):
        """Values of the last received PDO of that number, or None."""
        data = self.sent.get(communication)
        return struct.unpack(kind, data[0]) if data else None

    def state(self):
        """The state bits of the statusword."""
        return self.read(0x6041, 0, "<H") & 0x6F

    def position(self):
        """Flexion, rad."""
        return self.read(0x6064, 0, "<i") * MICRO


class Heartbeat:
    """Sends the host's heartbeat until it is stopped."""

    def __init__(self, network, period_s=0.02):
        self.network, self.period_s, self.runs = network, period_s, True
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def run(self):
        while self.runs:
            self.network.send_message(0x700 + HOST, b"\x05")
            time.sleep(self.period_s)

    def stop(self):
        self.runs = False
        self.thread.join()


def enable(joints):
    """Sends 6, 7, F; a leg is enabled once all of its joints have requested it.

    A stop is awaited first, such as that of a lost host: a word sent while it lasts is refused (FF0E, reason 23).
    """
    for joint in joints:
        until(f"the end of the stop of node {joint.number}", lambda: joint.read(0x6041, 0, "<H") & 0x6F != 0x07)
    for word, state in ((0x06, 0x21), (0x07, 0x23), (0x0F, 0x27)):
        for joint in joints:
            joint.write(0x6040, 0, word, "<H")
        for joint in joints:
            # Bit 15: the joint is enabled, the leg is not yet.
            until(f"state {state:02X} of node {joint.number}",
                  lambda: joint.read(0x6041, 0, "<H") & 0x806F == state)


def known(value):
    """Converts NaN to None."""
    return None if math.isnan(value) else value
