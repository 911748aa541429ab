"""The page's server: one origin for the page, the world's geometry, files and rosbridge."""
