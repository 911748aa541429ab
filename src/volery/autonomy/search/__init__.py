"""What UAVs need to search together: finding a colour, placing it, sharing the air, agreeing."""
