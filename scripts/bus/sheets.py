"""Compares electronic data sheets with live nodes: `sheets.py HOST:PORT FOLDER`.

First write the sheets: `cargo sim eds --out FOLDER`.

`canopen` must load both sheets without a warning. Then it reads each object with the information of the sheet
alone. Each object has the sheet's size and default, where there is one. Exactly the read-only objects refuse
a write for that reason. PDOs match the sheet, and no object answers that is not in it. The last line is
`sheets: ok`.
"""

import configparser
import logging
import os
import struct
import sys
import warnings

import canopen
from canopen.objectdictionary import ODVariable, datatypes
from canopen.sdo import SdoAbortedError

from scarab_bus import connect

# Objects without data yet: the list of errors, and results before the first identification.
NO_DATA = 0x08000024
WRITE_ONLY, READ_ONLY, NO_OBJECT, NO_SUBINDEX = 0x06010001, 0x06010002, 0x06020000, 0x06090011
# Indices outside the sheet: neighbours of each object, and ends of the range.
ELSEWHERE = [0x0001, 0x0FFF, 0x2000, 0x2141, 0x5FFF, 0x6000, 0x6003, 0x67FF, 0x9FFF, 0xFFFF]


class Complaints(logging.Handler):
    """Collects the library's log messages."""

    def __init__(self):
        super().__init__(logging.WARNING)
        self.messages = []

    def emit(self, record):
        self.messages.append(record.getMessage())


def load(folder, joint, number, complaints):
    """Loads a sheet with the library."""
    path = os.path.join(folder, f"scarab-{joint}.eds")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        dictionary = canopen.import_od(path, node_id=number)
    assert not complaints.messages, complaints.messages
    # The library has read every object of the file.
    sheet = configparser.RawConfigParser()
    sheet.optionxform = str
    sheet.read(path)
    listed = {int(value, 16) for kind in ("Mandatory", "Optional", "Manufacturer")
              for key, value in sheet.items(f"{kind}Objects") if key != "SupportedObjects"}
    assert listed == {index for index in dictionary if index >= 0x1000}, "objects that are lost on the way"
    return dictionary


def variables(dictionary):
    """Every variable of a dictionary."""
    for index in sorted(index for index in dictionary if index >= 0x1000):
        entry = dictionary[index]
        yield from [entry] if isinstance(entry, ODVariable) else entry.values()


def aborts(ask):
    """Abort code of a refused access, or None."""
    try:
        ask()
    except SdoAbortedError as error:
        return error.code
    return None


def check(node, variable):
    """Checks one variable of a live node and returns whether it had a value."""
    where = f"{variable.index:04X}:{variable.subindex}"
    if variable.access_type == "wo":
        code = aborts(lambda: node.sdo.upload(variable.index, variable.subindex))
        assert code == WRITE_ONLY, f"{where}, wo in the sheet: reading gave {code}"
        return False
    try:
        data = node.sdo.upload(variable.index, variable.subindex)
    except SdoAbortedError as error:
        assert error.code == NO_DATA and (variable.index == 0x1003 or 0x2100 <= variable.index < 0x2199), f"{where}: {error}"
        return False
    if variable.data_type in datatypes.NUMBER_TYPES or variable.data_type == datatypes.BOOLEAN:
        assert len(data) * 8 == len(variable), f"{where}: {len(data)} bytes, {len(variable)} bits in the sheet"
        if variable.default is not None:
            value = variable.decode_raw(data)
            assert value == variable.default, f"{where}: {value}, {variable.default} in the sheet"
    else:
        assert variable.data_type in (datatypes.VISIBLE_STRING, datatypes.DOMAIN), f"{where}: type {variable.data_type}"
    assert variable.access_type in ("ro", "rw", "const"), f"{where}: {variable.access_type}"
    # Writes the value that was read. A refusal for another reason is not one for read-only.
    code = aborts(lambda: node.sdo.download(variable.index, variable.subindex, data or b"\0"))
    assert (code == READ_ONLY) == (not variable.writable), f"{where}, {variable.access_type} in the sheet: writing gave {code}"
    return True


def check_pdos(node):
    """Reads each PDO's mapping with the library and compares it with the sheet."""
    node.tpdo.read()
    node.rpdo.read()
    maps = [("received", node.rpdo), ("sent", node.tpdo)]
    for way, pdos in maps:
        for number, pdo in pdos.items():
            assert pdo.enabled and len(pdo) >= 1, f"PDO {number} {way}"
            for variable in pdo:
                assert node.object_dictionary.get_variable(variable.index, variable.subindex) is not None
    return sum(len(pdos) for _, pdos in maps)


def main():
    address, folder = sys.argv[1:3]
    complaints = Complaints()
    logging.getLogger().addHandler(complaints)
    network = connect(address)
    for number, joint in ((1, "hip"), (2, "knee")):
        dictionary = load(folder, joint, number, complaints)
        node = canopen.RemoteNode(number, dictionary)
        network.add_node(node)
        node.sdo.RESPONSE_TIMEOUT = 5.0
        found = [check(node, variable) for variable in variables(dictionary)]
        pdos = check_pdos(node)
        known = {(variable.index, variable.subindex) for variable in variables(dictionary)}
        beside = {(index + 1, 0) for index, _ in known} | {(index, sub + 1) for index, sub in known}
        beside |= {(index, 0) for index in ELSEWHERE}
        for index, sub in sorted(beside - known):
            if index > 0xFFFF or sub > 0xFF:
                continue
            code = aborts(lambda: node.sdo.upload(index, sub))
            expected = NO_SUBINDEX if any(index == other for other, _ in known) else NO_OBJECT
            assert code == expected, f"{index:04X}:{sub}, which the sheet does not have: {code}"
        # Access by name, as a user of the sheet does.
        assert node.sdo["Statusword"].raw & 0x6F == 0x40
        assert struct.unpack("<I", node.sdo["Device type"].data)[0] == 0x00020192
        assert not complaints.messages, complaints.messages
        print(f"{joint}: {len(found)} variables as in the sheet, {found.count(False)} of them without a value yet; {pdos} PDOs; "
              f"{len(beside - known)} others refused")
    network.disconnect()
    print("sheets: ok")


if __name__ == "__main__":
    main()
