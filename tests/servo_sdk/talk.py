"""Talks to simulated servos 13 to 17 with the maker's library: `pip install dynamixel-sdk`, then `python talk.py PORT BAUD`.

Prints what it read as one line of JSON. Each step is judged by `tests/servo_sdk.rs`.
"""
import json
import sys
import time

from dynamixel_sdk import (
    GroupBulkRead,
    GroupBulkWrite,
    GroupSyncRead,
    GroupSyncWrite,
    PacketHandler,
    PortHandler,
)

IDS = [13, 14, 15, 16, 17]
TORQUE, LED, GOAL, POSITION, VOLTAGE, TEMPERATURE = 64, 65, 116, 132, 144, 146

port = PortHandler(sys.argv[1])
handler = PacketHandler(2.0)
assert port.openPort() and port.setBaudRate(int(sys.argv[2]))
said = {}

said["ping"] = [handler.ping(port, servo) for servo in IDS + [12]]
found, result = handler.broadcastPing(port)
said["broadcast_ping"] = sorted([servo, *info] for servo, info in found.items())

said["led"] = [handler.write1ByteTxRx(port, 13, LED, 1), handler.read1ByteTxRx(port, 13, LED)]
said["read_only"] = handler.write4ByteTxRx(port, 13, POSITION, 5)
said["range"] = handler.write1ByteTxRx(port, 13, TORQUE, 2)

# The bytes FF FF FD FF: the servo stuffs its answer.
handler.write1ByteTxRx(port, 13, 11, 4)
said["stuffed"] = [handler.write4ByteTxRx(port, 13, GOAL, 0xFFFDFFFF), handler.read4ByteTxRx(port, 13, GOAL)]
handler.write1ByteTxRx(port, 13, 11, 3)

said["registered"] = [handler.regWriteTxRx(port, 14, LED, 1, [1]), handler.read1ByteTxRx(port, 14, LED)]
handler.action(port, 14)
time.sleep(0.05)
port.clearPort()
said["registered"].append(handler.read1ByteTxRx(port, 14, LED))

for servo in IDS:
    handler.write2ByteTxRx(port, servo, 82, 1000)
    handler.write4ByteTxRx(port, servo, 112, 100)
    handler.write1ByteTxRx(port, servo, TORQUE, 1)
write = GroupSyncWrite(port, handler, GOAL, 4)
for servo in IDS:
    write.addParam(servo, list((1900 + 20 * servo).to_bytes(4, "little")))
write.txPacket()
time.sleep(2.5)

read = GroupSyncRead(port, handler, POSITION, 4)
for servo in IDS:
    read.addParam(servo)
for name, ask in (("sync", read.txRxPacket), ("fast_sync", read.fastSyncRead)):
    result = ask()
    said[name] = [result, [read.getData(servo, POSITION, 4) for servo in IDS]]

bulk = GroupBulkRead(port, handler)
for servo, address, length in ((13, POSITION, 4), (15, VOLTAGE, 2), (17, TEMPERATURE, 1)):
    bulk.addParam(servo, address, length)
for name, ask in (("bulk", bulk.txRxPacket), ("fast_bulk", bulk.fastBulkRead)):
    result = ask()
    said[name] = [result, bulk.getData(13, POSITION, 4), bulk.getData(15, VOLTAGE, 2), bulk.getData(17, TEMPERATURE, 1)]

put = GroupBulkWrite(port, handler)
put.addParam(15, TORQUE, 1, [0])
put.addParam(16, LED, 1, [1])
put.txPacket()
said["bulk_write"] = [handler.read1ByteTxRx(port, 15, TORQUE), handler.read1ByteTxRx(port, 16, LED)]

said["reboot"] = handler.reboot(port, 17)
time.sleep(0.5)
said["rebooted"] = handler.read1ByteTxRx(port, 17, TORQUE)
said["clear"] = handler.clearMultiTurn(port, 17)
said["reset"] = handler.factoryReset(port, 17, 2)
time.sleep(0.5)
said["after_reset"] = handler.read2ByteTxRx(port, 17, 84)
port.closePort()
print(json.dumps(said))
