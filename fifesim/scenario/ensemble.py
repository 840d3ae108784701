"""Many realisations of scenarios in memory: small scenes without a graph each."""

from fifesim.scenario.simulation import simulate

# Of a run, what a regression takes.
KEPT = ("image", "truth")


def realise(scenario, keep=KEPT):
    """
    Nodes of a scenario's run, in memory.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
    keep : sequence of str, optional
        Among ``scene``, ``image``, ``truth``, ``terrain`` and ``level``; the others are not computed.

    Returns
    -------
    nodes : dict of str to xarray.Dataset
        With the bits of `fifesim.simulate`.

    Raises
    ------
    ValueError
        If the run has no such node, or the scenario asks for what cannot be.
    """
    run = simulate(scenario)
    missing = [name for name in keep if name not in run.children]
    if missing:
        raise ValueError(f"keep names {', '.join(missing)}, and this run has {', '.join(run.children)}")
    return {name: run[name].to_dataset().compute(scheduler="synchronous") for name in keep}
