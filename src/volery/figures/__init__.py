"""Drawings of flights: maps as PNG, charts as SVG, from plain `FlightData`.

Reports, results and logs use them; nothing here reads a simulation or a file.
"""
