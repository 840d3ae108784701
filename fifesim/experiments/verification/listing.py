"""Deviations as text, for people to read."""

HEADING = f"{'':13}{'compared':<48}{'largest':>10}{'bound':>10} {'unit':<8}with"


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
