"""Draws flights: maps as PNG, charts as SVG, from plain `FlightData`.

Reports, results of flights and logs use these drawings.
"""
