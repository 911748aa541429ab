"""Simultaneous localisation and mapping: an inertial filter corrected by what LIDARs see again."""
