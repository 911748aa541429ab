"""Plants and little kernels that the vehicle tests share."""

import numpy as np

from volery.vehicle.airframe import Airframe, load_airframe
from volery.vehicle.fleet import charge_battery, fit_rotors, new_bodies
from volery.vehicle.plant import plant_of

F450 = load_airframe("f450")
LEVEL = [0.0, 0.0, 0.0, 1.0]


def plant(airframe=F450, dt=1e-3, period=0.04, wear=()):
    return plant_of(airframe, dt, period, wear)


def body(plants, health=1.0, charge=1.0, position=(0.0, 0.0, 50.0)):
    """A body (1,) of `plants[0]`, at rest."""
    bodies = new_bodies(np.array([position], dtype=float), np.array([LEVEL]))
    fit_rotors(bodies[0], plants[0], np.broadcast_to(health, int(plants["rotors"][0])))
    charge_battery(bodies[0], plants[0], charge)
    return bodies


def with_places(places, base=F450, **body_changes) -> Airframe:
    """`base` with rotors at `places`: (x, y, z, sense[, axis])."""
    data = base.model_dump()
    data["name"] = "mine"
    data["body"] |= {"collision_radius_m": 1.0, **body_changes}
    data["rotors"]["places"] = [
        {"position_m": p[:3], "direction": p[3], **({"axis": p[4]} if len(p) > 4 else {})}
        for p in places
    ]
    return Airframe.model_validate(data)


def ring(count, radius=0.3, height=0.02, lean=0.0, **body_changes) -> Airframe:
    """`count` rotors on a ring that lean `lean` rad along it, in turns to the left and right."""
    angle = (np.arange(count) + 0.5) * 2 * np.pi / count
    sign = np.where(np.arange(count) % 2, 1.0, -1.0)
    return with_places(
        [
            (
                radius * np.cos(a),
                radius * np.sin(a),
                height,
                "ccw" if s > 0 else "cw",
                (-np.sin(a) * np.sin(lean) * s, np.cos(a) * np.sin(lean) * s, np.cos(lean)),
            )
            for a, s in zip(angle, sign, strict=True)
        ],
        **body_changes,
    )


def coaxial_octo(**body_changes) -> Airframe:
    """X8: four arms, on each an upper and a lower rotor that turn against each other."""
    places = []
    for k, a in enumerate((np.arange(4) + 0.5) * np.pi / 2):
        x, y = 0.3 * np.cos(a), 0.3 * np.sin(a)
        upper, lower = ("ccw", "cw") if k % 2 else ("cw", "ccw")
        places += [(x, y, 0.05, upper), (x, y, -0.03, lower)]
    return with_places(places, **body_changes)
