"""The synthetic parts of a scenario and its overpass, in words for its file, its report and titles."""

from fifesim.base import fife
from fifesim.base.times import utc
from fifesim.ground.landscape.distribution import treatments
from fifesim.rasters.sites import on_fife_site
from fifesim.scenario.keys import EXTENT

_PATTERNS = {"pastures": "fields", "voronoi": "patches", "levels": "patches"}
_VARYING = {"soil": "soil brightness", "moisture": "soil moisture", "brown": "dead leaves"}
_PLURALS = {*_PATTERNS.values(), "dead leaves", "hills"}
_COUNTS = {1: "grass type", 2: "two grass types", 3: "three grass types"}


def statement(scenario):
    """
    The synthetic parts of a scenario, the parts that come from files, and the overpass.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario

    Returns
    -------
    text : str
        One line. It is the same for a scenario and for the complete one, unless a LAI file decides on the grid.

    Examples
    --------
    >>> from fifesim import Scenario
    >>> statement(Scenario(terrain={"dem": "konza.tif"}, geometry={"time": "1987-08-15T16:40Z"})).split(". ")[0]
    'Partly synthetic landscape: leaf area is synthetic; elevation is from a file'
    """
    synthetic, given = _parts(scenario)
    clauses = [f"{_listed(synthetic)} {_are(synthetic)} synthetic"] if synthetic else []
    if given:
        clauses.append(f"{_listed(given)} {_are(given)} from {'files' if len(given) > 1 else 'a file'}")
    if scenario.terrain.dem == "flat":
        clauses.append("the ground is level")
    of_fife = () if given else _of_fife(scenario)
    if of_fife:
        clauses.append(f"only {_listed(of_fife)} {_are(of_fife)} FIFE's")
    text = "; ".join(clauses)
    landscape = _landscape(synthetic, given)
    text = f"{landscape}: {text}." if landscape else f"{text}."
    return f"{text[0].upper()}{text[1:]} {_overpass(scenario)}".rstrip()


def summary(scenario):
    """
    The synthetic parts of a scenario in a few words for a title.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario

    Returns
    -------
    text : str
        Empty if ground and elevation come from files, or the ground is level, and the time is given.

    Examples
    --------
    >>> from fifesim import Scenario
    >>> summary(Scenario())
    'synthetic landscape, hypothetical overpass'
    """
    overpass = "hypothetical overpass" if _is_hypothetical(scenario) else ""
    return ", ".join(filter(None, (_landscape(*_parts(scenario)), overpass)))


def _parts(scenario):
    """Names of the synthetic parts of the landscape, and of those that come from files."""
    ground, cover, dem = scenario.ground, scenario.landscape.cover, scenario.terrain.dem
    synthetic, given = [], ["leaf area"] if ground.lai_file else []
    if cover in _PATTERNS:
        synthetic.append(_PATTERNS[cover])
    else:
        synthetic += [] if ground.lai_file else ["leaf area"]
        given += [] if cover == "none" else ["land cover"]
        synthetic += [
            _VARYING.get(name, name.replace("_", " ")) for name, value in scenario.landscape.deviations.items() if value
        ]
    if dem == "flint-hills":
        synthetic.append("hills")
    elif dem != "flat":
        given.append("elevation")
    return synthetic, given


def _landscape(synthetic, given):
    if not synthetic:
        return ""
    return "partly synthetic landscape" if given else "synthetic landscape"


def _of_fife(scenario):
    """Parts of a landscape without files that are FIFE's."""
    types = _distributions(scenario)
    found = [f"the {_COUNTS[len(types)]}"] if types <= set(treatments()) else []
    return found + ["the location"] * _is_on_site(scenario)


def _distributions(scenario):
    """Sources of the leaf area of a landscape without files."""
    own = scenario.ground.distribution
    if scenario.landscape.cover == "none":
        return {own}
    stands = scenario.classes.values()
    return {each.distribution if "distribution" in each.model_fields_set else own for each in stands} or set(
        treatments()
    )


def _is_on_site(scenario):
    """Whether the scenario is known to lie on the FIFE site; no file is opened for it."""
    if scenario.ground.lai_file and not scenario.grid.model_fields_set.intersection(EXTENT):
        return False
    try:
        return on_fife_site(scenario.geobox())
    except ValueError:
        # An invalid grid is refused where the scenario is completed.
        return False


def _is_hypothetical(scenario):
    """Whether the time is the default one on the FIFE site, on which no Landsat passed."""
    given = scenario.geometry
    default = given.time is None or utc(given.time)[0] == utc(fife.TIME)[0]
    return given.sza is None and default and _is_on_site(scenario)


def _overpass(scenario):
    given = scenario.geometry
    if given.sza is not None:
        return "Sun angles as given."
    if _is_hypothetical(scenario):
        return f"Hypothetical overpass, {_time(fife.TIME)}."
    return "" if given.time is None else f"Time as given, {_time(given.time)}."


def _time(time):
    (known,) = utc(time)
    return f"{known.day} {known.month_name()} {known.year} {known:%H:%M} UTC"


def _listed(names):
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last


def _are(names):
    plural = len(names) > 1 or names[0] in _PLURALS or names[0].endswith("types")
    return "are" if plural else "is"
