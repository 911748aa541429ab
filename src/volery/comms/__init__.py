"""Radio communication between UAVs and ground: stations, and the server that connects them."""
