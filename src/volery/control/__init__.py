"""Control: from position setpoints down to rotor speeds, in layers that each accept commands."""
