"""Child processes that receive signals."""

import signal
import subprocess

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def start_child(command, **options):
    """`Popen` with default dispositions in the child; `nohup` and `&` hand on ignored ones."""
    ignored = [number for number in _SIGNALS if signal.getsignal(number) is signal.SIG_IGN]
    for number in ignored:
        signal.signal(number, signal.SIG_DFL)
    try:
        return subprocess.Popen(command, **options)
    finally:
        for number in ignored:
            signal.signal(number, signal.SIG_IGN)
