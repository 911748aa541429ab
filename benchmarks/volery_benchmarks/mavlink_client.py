"""Sends requests to a vehicle over UDP and prints each response time in ms.

python -m volery_benchmarks.mavlink_client PORT COUNT
"""

from __future__ import annotations

import json
import socket
import sys
import time

from volery.mavlink.codec import Codec, dialect
from volery.mavlink.framing import Framer

_PAUSE_S = 0.013
"""Pause between two commands, s, not a multiple of any stream's period."""
_ACK = 77


def main() -> None:
    """Requests the home position COUNT times at PORT."""
    port, count = int(sys.argv[1]), int(sys.argv[2])
    codec, framer = Codec(245, 190), Framer()
    command = dialect().MAVLink_command_long_message(1, 1, 512, 0, 242.0, 0, 0, 0, 0, 0, 0)
    found = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.bind(("127.0.0.1", port))
        link.settimeout(10.0)
        _, vehicle = link.recvfrom(65535)
        for number in range(count):
            asked = time.perf_counter()
            link.sendto(codec.pack(command, number % 256), vehicle)
            while not any(f.message == _ACK for f in framer.datagram(link.recv(65535))):
                pass
            found.append(1e3 * (time.perf_counter() - asked))
            until = time.perf_counter() + _PAUSE_S
            while time.perf_counter() < until:
                link.recv(65535)
    sys.stdout.write(json.dumps(found))


if __name__ == "__main__":
    main()
