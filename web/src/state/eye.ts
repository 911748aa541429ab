/** Where the scene is seen from, in the map: written by the scene's frame loop, read by the map. */
export const eye = {
  x: 0,
  y: 0,
  z: 0,
  /** Of the line of sight, rad from the map's x axis to the left. */
  heading: 0,
  /** Horizontal field of view, rad; 0: nothing is shown yet. */
  width: 0,
};
