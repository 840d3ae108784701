"""Compute instruments.csv: what each instrument loses over the same ground. It takes half an hour of a processor."""

from pathlib import Path

from fifesim.experiments.scatter.instruments import compare_instruments

NAMES = (
    "MSI", "MSI-B", "MSI-C", "HRV", "TM", "L4TM", "ETM+", "OLI", "OLI2", "EnMAP", "PRISMA", "EMIT", "MSS", "MSS4",
    "MODIS", "MODIS-Aqua", "OLCI", "VIIRS", "AVHRR",
)  # fmt: skip


def main():
    table = compare_instruments(NAMES)
    kept = [
        "instrument",
        "pixel",
        "blur",
        "noise",
        "place",
        "arp",
        "variable",
        "stage",
        "share",
        "share_error",
    ]
    table[kept].to_csv(
        Path(__file__).with_name("instruments.csv"), index=False, float_format="%.4g"
    )


if __name__ == "__main__":
    main()
