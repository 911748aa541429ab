"""The result of a flight: its states as arrays, with tables and figures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from volery.results.flight_states import FlightStates

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False, repr=False)
class FlightResult(FlightStates):
    """The flight of n UAVs, T samples of the true states; nan where a UAV did not exist.

    `result["uav1"]` is one UAV's flight, `to_pandas()` a table of all samples, `summary()` one row
    of numbers for the table of a study, `plot()` a map with the paths.
    """

    # ------------------------------------------------------------------------------------- tables

    def to_pandas(self) -> pandas.DataFrame:
        """Returns a table with a row for each sample of each UAV; needs pandas.

        Columns: `time_s`, `uav`, `x_m` to `z_m`, `vx_m_s` to `vz_m_s`, `qx` to `qw`, `wx_rad_s` to
        `wz_rad_s`, `battery_charge`, `mode` (names). Samples of UAVs that did not exist are left
        out.
        """
        from volery.results.tables import flight_table

        return flight_table(self)

    def events_to_pandas(self) -> pandas.DataFrame:
        """Returns a table of the events; needs pandas.

        Columns: `time_s`, `uav`, `kind`, `partner`, `detail`, `speed_m_s`, `x_m`, `y_m`, `z_m`.
        """
        from volery.results.tables import events_table

        return events_table(self.events)

    # ------------------------------------------------------------------------------------ figures

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draws the paths from above, with trees and solids; returns matplotlib's axes.

        axes: where to draw; None: a new figure of pyplot. `plot().figure.savefig("paths.png")`
        writes a file.
        """
        from volery.results.drawing import draw_flight

        return draw_flight(self, axes)

    def plot_over_time(self, quantity: str = "height", axes: Axes | None = None) -> Axes:
        """Draws a quantity of each UAV over time; returns matplotlib's axes.

        quantity: `height` (z in the map, m), `x`, `y`, `speed` (m/s) or `battery` (fraction).
        """
        from volery.results.drawing import draw_over_time

        return draw_over_time(self, quantity, axes)

    def _repr_png_(self) -> bytes:
        """Returns the map with the paths, for notebooks."""
        from volery.results.drawing import flight_png

        return flight_png(self)

    def _repr_html_(self) -> str:
        """Returns a line of text and the map with the paths, for notebooks."""
        from volery.results.drawing import flight_html

        return flight_html(self)
