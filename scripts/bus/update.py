"""Updates a board by Python's `canopen`, with the objects of CiA 302-3 (docs/update.md, section 3).

update.py ADDRESS SHEETS IMAGE.bin block|segments

SHEETS is the folder that `cargo sim eds` writes. `cargo chip serve --delivered --next IMAGE.bin` serves a board and
writes a new image for it.
"""

import sys
import time

import canopen

from scarab_bus import connect

CONTROL, DATA, SOFTWARE, STATUS = 0x1F51, 0x1F50, 0x1F56, 0x1F57
STOP, START, CLEAR = 0, 1, 3
UNDER_WAY, STOPPED, ON_TRIAL = 1, 1 << 8, 1 << 10


def main():
    address, sheets, path, way = sys.argv[1:5]
    network = connect(address)
    node = canopen.RemoteNode(1, f"{sheets}/scarab-hip.eds")
    network.add_node(node)
    # No request is answered during an erase.
    node.sdo.RESPONSE_TIMEOUT = 6.0

    def read(index):
        return int.from_bytes(node.sdo.upload(index, 1), "little")

    def command(number):
        node.sdo.download(CONTROL, 1, bytes([number]))

    def settled():
        while (status := read(STATUS)) & UNDER_WAY:
            time.sleep(0.1)
        return status

    before = read(SOFTWARE)
    command(STOP)
    assert settled() & STOPPED
    command(CLEAR)
    assert settled() == STOPPED | 1 << 9
    with open(path, "rb") as file:
        image = file.read()
    begun = time.monotonic()
    with node.sdo.open(DATA, 1, "wb", size=len(image), block_transfer=way == "block", buffering=889) as domain:
        domain.write(image)
    assert settled() == STOPPED, hex(read(STATUS))
    print(f"{len(image)} bytes by {way} in {time.monotonic() - begun:.1f} s")
    command(START)
    while True:
        try:
            if not read(STATUS) & (STOPPED | UNDER_WAY):
                break
        except canopen.SdoCommunicationError:
            pass  # The images are swapped.
        time.sleep(0.2)
    assert settled() == ON_TRIAL and read(SOFTWARE) != before
    command(START)
    assert settled() == 0
    print(f"update: ok, image {before:08X} replaced by {read(SOFTWARE):08X}")
    network.disconnect()


main()
