"""The paper's case: where and when."""

# A hypothetical overpass: the paper simulates TM for this day (section Data), on which no Landsat passed the FIFE site
# (WRS-2 cycle). It states no time: this is about when one passed on other days.
TIME = "1987-06-06T16:35:00Z"
LATITUDE = 39.06  # [degree north]
LONGITUDE = -96.54  # [degree east]
ALTITUDE = 400.0  # [m]


# The site is a square, in UTM zone 14. [m]
SIZE = 15000.0
# FIFE's own corner in NAD27, and the nearest point of the 30 m lattice of today's NAD83 elevation models to the place
# that a Helmert transformation (EPSG:1173, good to 7 m) gives it: 704968 E 4334211 N.
CORNERS = {"NAD83": ("EPSG:26914", 704970.0, 4334220.0), "NAD27": ("EPSG:26714", 705000.0, 4334000.0)}
