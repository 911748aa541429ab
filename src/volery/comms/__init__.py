"""Radio communication between UAVs and ground: stations, and the server that joins them."""
