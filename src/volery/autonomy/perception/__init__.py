"""What nodes make of their sensors' messages: points, rays, motion, frames."""
