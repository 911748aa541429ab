"""The illustrated report of a flight: data collected during the run, then one HTML page.

`FlightCollector` subscribes to the graph of a running simulation and returns plain `FlightData`;
`volery.figures` draws them, `page` combines them in one self-contained file.
"""
