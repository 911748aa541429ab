"""Control: from a place to go to down to rotor speeds, in layers that can each be commanded."""
