"""Stops a rotor in flight."""

import volery
from volery.scenario import MotorFault

with volery.make("hover") as run:
    run.faults.inject(MotorFault(uav="uav1", rotor=0, at_s=4.0))
    run.run(8.0)
