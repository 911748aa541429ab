"""What stands in the map: terrain, trees, forests, and the rays cast at them."""
