"""What the maker's library makes of bytes on a bus: `pip install dynamixel-sdk`, then `python wire.py HEX`.

Prints one line of JSON: of each packet its id, its instruction, the library's CRC over it, the CRC that it has, and the bytes that
the library sends for the same contents (null where it had to take stuffing out).
"""
import json
import sys

from dynamixel_sdk import PacketHandler

HEADER = b"\xff\xff\xfd\x00"
handler = PacketHandler(2.0)


class Paper:
    """A port that keeps what is written."""

    is_using = False
    written = b""

    def clearPort(self):
        pass

    def writePort(self, packet):
        self.written = bytes(packet)
        return len(packet)


def read(packet):
    crc = handler.updateCRC(0, list(packet), len(packet) - 2)
    has = packet[-2] + 256 * packet[-1]
    plain = handler.removeStuffing(list(packet))
    port = Paper()
    sent = None
    if plain == list(packet):
        handler.txPacket(port, plain[:-2] + [0, 0])
        sent = port.written.hex()
    return [packet[4], packet[7], crc, has, packet.hex(), sent]


wire = bytes.fromhex(sys.stdin.read())
packets = []
while wire:
    if not wire.startswith(HEADER):
        sys.exit(f"no header after {len(packets)} packets: {wire[:16].hex()}")
    length = 7 + wire[5] + 256 * wire[6] if len(wire) > 6 else 7
    if length > len(wire):
        break  # the record ends within a packet
    packets.append(read(wire[:length]))
    wire = wire[length:]
print(json.dumps(packets))
