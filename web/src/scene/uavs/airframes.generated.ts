// Written by `python tools/typescript_airframes.py` from the airframes' data files.
// A test of the project fails when this file is older than they are.

/** Body axes: x forward, y left, z up; metres. */
export interface AirframeShape {
  title: string;
  /** Sides of the box between the rotors. */
  size: readonly [number, number, number];
  rotorRadius: number;
  /** x, y, z, axis x, y, z, and 1 for counter-clockwise seen from above, else -1. */
  rotors: readonly (readonly number[])[];
  feet: readonly (readonly number[])[];
  colours: AirframeColours;
}

export interface AirframeColours {
  front: string;
  back: string;
  plates: string;
  legs: string;
}

export const AIRFRAMES: Readonly<Record<string, AirframeShape>> = {
  crazyflie: {
    title: "Bitcraze Crazyflie 2.x",
    size: [0.05, 0.05, 0.025],
    rotorRadius: 0.0231348,
    rotors: [
      [0.028, -0.028, 0, 0, 0, 1, 1],
      [-0.028, -0.028, 0, 0, 0, 1, -1],
      [-0.028, 0.028, 0, 0, 0, 1, 1],
      [0.028, 0.028, 0, 0, 0, 1, -1],
    ],
    feet: [
      [0.028, 0.028, -0.02],
      [-0.028, 0.028, -0.02],
      [-0.028, -0.028, -0.02],
      [0.028, -0.028, -0.02],
    ],
    colours: { front: "#1f3b2a", back: "#1f3b2a", plates: "#1f3b2a", legs: "#e0e0dc" },
  },
  f450: {
    title: "DJI F450 (OpenUAV)",
    size: [0.24, 0.24, 0.14],
    rotorRadius: 0.12,
    rotors: [
      [0.159, -0.159, 0.11, 0, 0, 1, 1],
      [-0.159, 0.159, 0.11, 0, 0, 1, 1],
      [0.159, 0.159, 0.11, 0, 0, 1, -1],
      [-0.159, -0.159, 0.11, 0, 0, 1, -1],
    ],
    feet: [
      [0.13, 0.13, -0.12],
      [-0.13, 0.13, -0.12],
      [-0.13, -0.13, -0.12],
      [0.13, -0.13, -0.12],
    ],
    colours: { front: "#c8201c", back: "#e0e0dc", plates: "#26282b", legs: "#26282b" },
  },
  hummingbird: {
    title: "AscTec Hummingbird (RotorS)",
    size: [0.1, 0.1, 0.12],
    rotorRadius: 0.1,
    rotors: [
      [0.17, 0, 0.01, 0, 0, 1, -1],
      [0, 0.17, 0.01, 0, 0, 1, 1],
      [-0.17, 0, 0.01, 0, 0, 1, -1],
      [0, -0.17, 0.01, 0, 0, 1, 1],
    ],
    feet: [
      [0.1, 0.1, -0.07],
      [-0.1, 0.1, -0.07],
      [-0.1, -0.1, -0.07],
      [0.1, -0.1, -0.07],
    ],
    colours: { front: "#e0a020", back: "#26282b", plates: "#26282b", legs: "#4a4f57" },
  },
  iris: {
    title: "3DR Iris (PX4)",
    size: [0.24, 0.16, 0.11],
    rotorRadius: 0.128,
    rotors: [
      [0.13, -0.22, 0.023, 0, 0, 1, 1],
      [-0.13, 0.2, 0.023, 0, 0, 1, 1],
      [0.13, 0.22, 0.023, 0, 0, 1, -1],
      [-0.13, -0.2, 0.023, 0, 0, 1, -1],
    ],
    feet: [
      [0.12, 0.18, -0.1],
      [-0.12, 0.16, -0.1],
      [-0.12, -0.16, -0.1],
      [0.12, -0.18, -0.1],
    ],
    colours: { front: "#1c5fa8", back: "#26282b", plates: "#26282b", legs: "#26282b" },
  },
};

/** Of an airframe without colours. */
export const USUAL_COLOURS: AirframeColours = {
  front: "#e0662a",
  back: "#4a4f57",
  plates: "#26282b",
  legs: "#26282b",
};
