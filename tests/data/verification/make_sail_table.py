"""
Make sail.csv, canopies by another implementation of SAIL.

Needs prosail. Leaf angles are Verhoef's, in 18 classes; there is no hot spot. Run it in this folder.
"""

import numpy as np
import pandas as pd
from prosail.FourSAIL import foursail

HEADER = """# Source: the SAIL model of prosail 2.0.5 (github jgomezdans/prosail), no hot spot, by make_sail_table.py.
# a, b: Verhoef's leaf angle parameters [1], 18 classes; lai [m2 m-2], angles [degree], all else [1]; raa 0 has sun and
# sensor on the same side. rdd, rsd, rdo, rso: canopy over its background, of the diffuse or the direct light (first
# letter d or s), in the mean or toward the observer (last letter d or o); tss: sunlight that passes the canopy.
"""


def canopies(count, seed):
    """Random canopies, one a row."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        a = rng.uniform(-0.8, 0.8)
        b = rng.uniform(-1, 1) * (0.95 - abs(a))
        rho, tau = 0.98 * rng.dirichlet([1, 1, 0.5])[:2]
        sza, vza, raa = rng.uniform(0, [80, 70, 180])
        lai, background = rng.uniform(0.05, [8, 0.6])
        a, b, rho, tau, lai, background = np.round([a, b, rho, tau, lai, background], 4).tolist()
        sza, vza, raa = np.round([sza, vza, raa], 2).tolist()
        one = np.ones(1)
        found = [
            float(np.squeeze(value))
            for value in foursail(rho * one, tau * one, a, b, 1, lai, 0.0, sza, vza, raa, background * one)
        ]
        yield a, b, rho, tau, lai, sza, vza, raa, background, *(found[i] for i in (12, 13, 14, 17, 0))


if __name__ == "__main__":
    columns = ["a", "b", "leaf_reflectance", "leaf_transmittance", "lai", "sza", "vza", "raa", "background"]
    columns += ["rdd", "rsd", "rdo", "rso", "tss"]
    table = pd.DataFrame(canopies(60, seed=20), columns=columns)
    with open("sail.csv", "w", encoding="utf-8") as sink:
        sink.write(HEADER)
        table.to_csv(sink, index=False, float_format="%.12g", lineterminator="\n")
