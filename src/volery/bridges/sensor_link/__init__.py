"""The sensor link: binary frames with CRC-16, images on a port of their own."""
