"""All weathers in one image: `python tests/golden/montage.py docs/pictures/weather.png`."""

import sys

import numpy as np
from matplotlib import image
from studio import WEATHERS, Studio

COLUMNS = 3


def main(path):
    studio = Studio("forest")
    seen = [studio.shoot(weather, 300, parts=("colour",)).colour[0] for weather in WEATHERS]
    studio.close()
    rows = [np.hstack(seen[k : k + COLUMNS]) for k in range(0, len(seen), COLUMNS)]
    image.imsave(path, np.vstack(rows))


if __name__ == "__main__":
    main(*sys.argv[1:])
