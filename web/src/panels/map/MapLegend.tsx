/** What the sector on the map is. */
export function MapLegend() {
  return (
    <div className="map-legend">
      <span className="map-sector" aria-hidden />
      your view
    </div>
  );
}
