"""Processing of sensor messages: points, rays, motion, frames."""
