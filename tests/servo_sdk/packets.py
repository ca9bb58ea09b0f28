"""What the maker's library sends, and what it makes of answers: `pip install dynamixel-sdk`, then `python packets.py HEX...`.

Prints one line of JSON: the packets of its instructions, and the bytes after the instruction of each answer given as HEX.
"""
import json
import sys

from dynamixel_sdk import GroupBulkRead, GroupBulkWrite, GroupSyncRead, GroupSyncWrite, PacketHandler


class Paper:
    """A port that keeps what is written and yields what it was given."""

    is_using = False
    written = b""

    def __init__(self, heard=b""):
        self.heard = heard

    def clearPort(self):
        pass

    def writePort(self, packet):
        self.written = bytes(packet)
        return len(packet)

    def readPort(self, length):
        taken, self.heard = self.heard[:length], self.heard[length:]
        return taken

    def setPacketTimeout(self, _):
        pass

    def isPacketTimeout(self):
        return not self.heard


handler = PacketHandler(2.0)


def sent(ask):
    port = Paper()
    ask(port)
    return port.written.hex()


def group(make, add, send="txPacket"):
    def ask(port):
        group = make(port)
        add(group)
        getattr(group, send)()

    return sent(ask)


def everyone(group):
    for servo in range(13, 18):
        group.addParam(servo)


def goals(group):
    for servo in range(13, 18):
        group.addParam(servo, [servo, 2, 3, 4])


def two(group):
    group.addParam(13, 132, 4)
    group.addParam(14, 146, 1)


def puts(group):
    group.addParam(13, 116, 4, [1, 2, 3, 4])
    group.addParam(14, 65, 1, [1])


packets = {
    "ping": sent(lambda port: handler.ping(port, 7)),
    "read": sent(lambda port: handler.readTx(port, 200, 132, 4)),
    "write": sent(lambda port: handler.write4ByteTxOnly(port, 3, 116, 0x12345678)),
    "reg_write": sent(lambda port: handler.regWriteTxOnly(port, 9, 102, 2, [0x12, 0x34])),
    "action": sent(lambda port: handler.action(port, 254)),
    "factory_reset": sent(lambda port: handler.factoryReset(port, 5, 2)),
    "reboot": sent(lambda port: handler.reboot(port, 252)),
    "clear": sent(lambda port: handler.clearMultiTurn(port, 1)),
    "sync_write": group(lambda port: GroupSyncWrite(port, handler, 116, 4), goals),
    "sync_read": group(lambda port: GroupSyncRead(port, handler, 126, 10), everyone),
    "fast_sync_read": group(lambda port: GroupSyncRead(port, handler, 126, 10), everyone, "fastSyncReadTxPacket"),
    "bulk_read": group(lambda port: GroupBulkRead(port, handler), two),
    "fast_bulk_read": group(lambda port: GroupBulkRead(port, handler), two, "fastBulkReadTxPacket"),
    "bulk_write": group(lambda port: GroupBulkWrite(port, handler), puts),
}
answers = []
for text in sys.argv[1:]:
    packet, result = handler.rxPacket(Paper(bytes.fromhex(text)), False)
    length = packet[5] + 256 * packet[6]
    answers.append([result, packet[4], bytes(packet[8 : 7 + length - 2]).hex()])
print(json.dumps({"packets": packets, "answers": answers}))
