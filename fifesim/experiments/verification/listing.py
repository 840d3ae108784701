"""Deviations as text, for people to read."""

HEADING = f"{'':13}{'compared':<48}{'largest':>10}{'bound':>10} {'unit':<8}with"

# The stages of Figure 1 that the areas are of, in the order of the way of a pixel.
STAGES = {
    "random field": "Ground",
    "canopy": "Ground",
    "terrain": "Ground",
    "atmosphere": "Atmosphere",
    "sensor": "Sensor",
    "analysis": "Analysis",
}


def by_stage(deviations):
    """
    Deviations line by line, below a heading for each stage.

    Parameters
    ----------
    deviations : iterable of fifesim.experiments.verification.deviations.Deviation
        Those of a stage one after the other.

    Yields
    ------
    text : str
        As soon as a deviation is known.

    Examples
    --------
    >>> from fifesim.experiments.verification.deviations import Deviation
    >>> [text.split()[0] for text in by_stage([Deviation("terrain", "slope", 0.1, 0.2, "degree", "plane")])]
    ['Ground', 'terrain']
    """
    stage = None
    for deviation in deviations:
        if STAGES[deviation.area] != stage:
            stage = STAGES[deviation.area]
            yield f"\n{stage}"
        yield line(deviation)


def line(deviation):
    """
    One deviation in one line.

    Parameters
    ----------
    deviation : fifesim.experiments.verification.deviations.Deviation

    Returns
    -------
    text : str

    Examples
    --------
    >>> from fifesim.experiments.verification.deviations import Deviation
    >>> " ".join(line(Deviation("terrain", "slope", 0.2, 0.1, "degree", "plane")).split())
    'terrain slope 0.2 0.1 degree plane EXCEEDED'
    """
    numbers = f"{deviation.deviation:>10.3g}{deviation.bound:>10.3g} {deviation.unit:<8}"
    mark = "" if deviation.within else "  EXCEEDED"
    return f"{deviation.area:<13}{deviation.what:<48}{numbers}{deviation.source}{mark}"


def summary(deviations):
    """
    What all deviations say together.

    Parameters
    ----------
    deviations : list of fifesim.experiments.verification.deviations.Deviation

    Returns
    -------
    text : str
        Names those that exceed their bounds.

    Examples
    --------
    >>> from fifesim.experiments.verification.deviations import Deviation
    >>> summary([Deviation("terrain", "slope", 0.1, 0.2, "degree", "plane")])
    '1 checks, all within their bounds'
    """
    exceeded = [f"{each.area}: {each.what}" for each in deviations if not each.within]
    if not exceeded:
        return f"{len(deviations)} checks, all within their bounds"
    return f"{len(deviations)} checks, {len(exceeded)} beyond their bounds: {'; '.join(exceeded)}"
