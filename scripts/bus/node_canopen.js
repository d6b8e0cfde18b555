// Runs npm's `canopen` against the simulated leg: `node node_canopen.js HOST:PORT`. The library has no
// adapter; frames are exchanged as objects, here over slcan on TCP. Tests all three kinds of transfer,
// network management, PDOs and a motion. The last line is `node-canopen: ok`.
'use strict';
const assert = require('node:assert');
const net = require('node:net');
const { Device, DataType, NmtState, ObjectType } = require('canopen');

const NODES = [1, 2];
const STATES = [[6, 0x21], [7, 0x23], [15, 0x27]];
const SPEED = 100000;

/** Sends and receives the device's frames as slcan lines. */
function connect(address, device) {
    const end = address.lastIndexOf(':');
    const socket = net.connect(Number(address.slice(end + 1)), address.slice(0, end));
    socket.setNoDelay(true);
    let rest = '';
    socket.on('data', (bytes) => {
        const lines = (rest + bytes.toString('latin1').replaceAll('\x07', '')).split('\r');
        rest = lines.pop();
        for (const line of lines) {
            if (line.startsWith('t'))
                device.receive({ id: parseInt(line.slice(1, 4), 16), data: Buffer.from(line.slice(5), 'hex') });
        }
    });
    device.on('message', ({ id, data }) => {
        const bytes = Buffer.from(data);
        socket.write(`t${id.toString(16).padStart(3, '0')}${bytes.length}${bytes.toString('hex')}\r`);
    });
    socket.write('C\rS8\rO\r');
    return new Promise((resolve) => socket.on('connect', () => resolve(socket)));
}

const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

async function until(what, condition) {
    for (const end = Date.now() + 20000; Date.now() < end; await sleep(5)) {
        if (await condition())
            return;
    }
    throw new Error(`waited 20 s for: ${what}`);
}

async function main(address) {
    const device = new Device({ id: 0x50 });
    const heartbeats = new Set();
    for (const node of NODES)
        device.eds.addSdoClientParameter(node, 0x600 + node, 0x580 + node);
    const word = device.eds.addEntry(0x2000, {
        objectType: ObjectType.VAR, parameterName: 'Statusword of the hip', dataType: DataType.UNSIGNED16,
    });
    device.eds.addReceivePdo({ cobId: 0x181, transmissionType: 255, dataObjects: [word] });
    for (const node of NODES)
        device.eds.addHeartbeatConsumer(node, 1000);
    const socket = await connect(address, device);
    device.nmt.on('heartbeat', ({ deviceId }) => heartbeats.add(deviceId));
    device.start();
    device.nmt.startNode(0);

    const read = (deviceId, index, subIndex, dataType, more) =>
        device.sdo.upload({ deviceId, index, subIndex, dataType, timeout: 2000, ...more });
    const write = (deviceId, index, subIndex, dataType, data) =>
        device.sdo.download({ deviceId, index, subIndex, dataType, data, timeout: 2000 });
    for (const node of NODES) {
        assert.equal(await read(node, 0x1000, 0, DataType.UNSIGNED32), 0x00020192);
        const name = await read(node, 0x1008, 0, DataType.VISIBLE_STRING);
        assert.ok(name.length > 4, name);
        const again = await read(node, 0x1008, 0, DataType.VISIBLE_STRING, { blockTransfer: true });
        assert.equal(again, name);
        await assert.rejects(read(node, 0x5FFF, 0, DataType.UNSIGNED32));
        await write(node, 0x1017, 0, DataType.UNSIGNED16, 50);
        // Sends the statusword every 20 ms.
        await write(node, 0x1800, 2, DataType.UNSIGNED8, 255);
        await write(node, 0x1800, 5, DataType.UNSIGNED16, 20);
    }
    await until('heartbeats', () => heartbeats.size === NODES.length);
    await until('the statusword by PDO', () => (word.value & 0x6F) === 0x40);
    console.log(`objects, heartbeats and PDOs: statusword ${word.value.toString(16)}`);

    for (const [control, state] of STATES) {
        for (const node of NODES)
            await write(node, 0x6040, 0, DataType.UNSIGNED16, control);
        for (const node of NODES)
            await until(`state ${state.toString(16)}`, async () => (await read(node, 0x6041, 0, DataType.UNSIGNED16) & 0x806F) === state);
    }
    await until('the statusword by PDO', () => (word.value & 0x806F) === 0x27);
    await write(1, 0x6060, 0, DataType.INTEGER8, 3);
    await write(1, 0x60FF, 0, DataType.INTEGER32, SPEED);
    await until('0.1 rad/s', async () => Math.abs(await read(1, 0x606C, 0, DataType.INTEGER32) - SPEED) < 40000);
    await write(1, 0x60FF, 0, DataType.INTEGER32, 0);
    for (const node of NODES)
        await write(node, 0x6040, 0, DataType.UNSIGNED16, 0);
    for (const node of NODES)
        await until('off', async () => (await read(node, 0x6041, 0, DataType.UNSIGNED16) & 0x6F) === 0x40);
    console.log('enabled, moved at 0.1 rad/s, switched off');
    device.stop();
    socket.end();
    console.log('node-canopen: ok');
}

main(process.argv[2]).then(() => process.exit(0), (error) => {
    console.error(error);
    process.exit(1);
});
