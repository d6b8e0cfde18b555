"""Writes concise device configuration files to live nodes: `concise.py HOST:PORT NODE=FILE...`.

A master writes such files at a node's boot-up.
The files come from Lely's `dcfgen`: a count, then index, subindex, length and bytes of each object. Every
write must be accepted, and a read must return the last written value. The last line is `concise: ok`.
"""

import struct
import sys

from scarab_bus import Joint, connect

HEAD = struct.Struct("<HBI")


def entries(data):
    """Index, subindex and bytes of each object."""
    count, place = struct.unpack_from("<I", data)[0], 4
    for _ in range(count):
        index, sub, length = HEAD.unpack_from(data, place)
        place += HEAD.size
        yield index, sub, data[place:place + length]
        place += length
    assert place == len(data), f"{len(data) - place} bytes are left"


def main():
    network = connect(sys.argv[1])
    for argument in sys.argv[2:]:
        number, path = argument.split("=", 1)
        joint = Joint(network, int(number))
        with open(path, "rb") as file:
            written = list(entries(file.read()))
        for index, sub, data in written:
            joint.node.sdo.download(index, sub, data)
        for (index, sub), data in {(index, sub): data for index, sub, data in written}.items():
            found = joint.node.sdo.upload(index, sub)
            if 0x1800 <= index < 0x1A00 and sub == 1:
                # No remote requests are answered, so bit 30 of a COB-ID always reads 1.
                data = struct.pack("<I", struct.unpack("<I", data)[0] | 1 << 30)
            assert found == data, f"node {number}, {index:04X}:{sub}: {found.hex()}, written was {data.hex()}"
        print(f"node {number}: {len(written)} objects written and read back")
    network.disconnect()
    print("concise: ok")


if __name__ == "__main__":
    main()
