"""The illustrated report of a flight: collect while it runs, then one HTML page.

`FlightCollector` listens to the graph of a running simulation and gives plain `FlightData`;
`figures` draws them, `page` sets them in one self-contained file.
"""
