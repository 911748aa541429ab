"""The bridge kind of this package; `pyproject.toml` names it."""

from __future__ import annotations

from volery.graph.bridge_kind import Address, Bridge, BridgeKind, BridgeOptions


def _comms(address: Address, options: BridgeOptions) -> Bridge:
    from volery.comms.station.station_bridge import StationBridge

    return StationBridge(*address, token=options.token)


COMMS = BridgeKind(10200, _comms)
