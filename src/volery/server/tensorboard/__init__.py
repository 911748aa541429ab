"""TensorBoard inside the page: its process, and the route that passes requests on to it."""
