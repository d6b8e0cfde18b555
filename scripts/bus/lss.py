"""Two boards with equal node-IDs get different ones by the LSS master of Python's `canopen`: `lss.py HOST:PORT`.

Both boards are new (`serve --legs 2 --new`). The second one is found by its serial number and set to 3 and 4. The
last line is `lss: ok`.
"""

import sys
import time

import canopen

from scarab_bus import Joint, connect, until

VENDOR, HIP, KNEE, REVISION = 0, 1, 2, 1 << 16
SERIALS = (1, 2)
# COB-ID of answers, and the service of a found node.
ANSWER, FOUND = 0x7E4, 0x4F


def main():
    network = connect(sys.argv[1])
    lss = network.lss
    lss.RESPONSE_TIMEOUT = 1.0

    answers = []
    network.subscribe(ANSWER, lambda _, data, when: answers.append(data[0]))

    def is_found(product, low, high):
        # The library's search returns nothing.
        answers.clear()
        lss.send_identify_remote_slave(VENDOR, product, REVISION, REVISION, low, high)
        found = FOUND in answers
        # Both boards may have answered.
        while not lss.responses.empty():
            lss.responses.get()
        return found

    def select(product, serial):
        lss.send_switch_state_global(lss.WAITING_STATE)
        try:
            return lss.send_switch_state_selective(VENDOR, product, REVISION, serial)
        except canopen.lss.LssError:
            return False

    until("a board", lambda: is_found(HIP, 0, 0xFFFFFFFF))
    for serial in SERIALS:
        assert is_found(KNEE, serial, serial), serial
    for low, high in ((0, 0), (3, 0xFFFFFFFF)):
        assert not is_found(HIP, low, high), (low, high)
    assert not select(HIP, 3)
    for serial in SERIALS:
        for product, number in ((HIP, 1), (KNEE, 2)):
            assert select(product, serial)
            identity = [lss.inquire_lss_address(service) for service in (0x5A, 0x5B, 0x5C, 0x5D)]
            assert identity == [VENDOR, product, REVISION, serial], identity
            assert lss.inquire_node_id() == number
    for product, number in ((HIP, 3), (KNEE, 4)):
        assert select(product, SERIALS[1])
        lss.configure_node_id(number)
    lss.RESPONSE_TIMEOUT = 10.0
    lss.store_configuration()
    lss.send_switch_state_global(lss.WAITING_STATE)
    network.nmt.send_command(0x82)
    for serial, numbers in zip(SERIALS, ((1, 2), (3, 4))):
        for product, number in zip((HIP, KNEE), numbers):
            joint = Joint(network, number)
            until(f"node {number}", lambda: joint.read(0x1018, 4) == serial)
            assert joint.read(0x1018, 2) == product
        print(f"board {serial}: nodes {numbers[0]}, {numbers[1]}")
    network.disconnect()
    print("lss: ok")


if __name__ == "__main__":
    main()
