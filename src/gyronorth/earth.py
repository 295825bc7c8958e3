"""Earth rate and gravity in the navigation frame n (north, east, down) at a latitude."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: Earth's rotation rate, rad/s: NIMA TR8350.2 (WGS 84), 3rd ed., 2000, table 3.1. 15.041 deg/h.
EARTH_RATE = 7.292115e-5
#: Equatorial semi-major axis, m: the same table 3.1.
SEMI_MAJOR_AXIS = 6378137.0
#: Flattening: the same, derived constants, table 3.3.
FLATTENING = 1 / 298.257223563
#: Normal gravity at the equator, m/s^2: the same, table 3.4.
GRAVITY_EQUATOR = 9.7803253359
#: Somigliana's constant: the same, table 3.4.
SOMIGLIANA = 0.00193185265241
#: First eccentricity squared: the same, table 3.3.
ECCENTRICITY_SQUARED = 6.69437999014e-3
#: Ratio m = omega^2 a^2 b / GM: the same, table 3.4.
GRAVITY_RATIO = 0.00344978650684
#: Standard gravity, m/s^2 (exact; 3rd CGPM, 1901): the unit g of data sheets.
STANDARD_GRAVITY = 9.80665


def earth_rate_n(latitude: ArrayLike) -> NDArray[np.float64]:
    """Earth rate in n, rad/s, shape (..., 3): rate x (cos lat, 0, -sin lat).

    `latitude` is geodetic, rad, shape (...). It is eq:3 of the paper applied to
    (0, 0, rate), with the misprint in its third row corrected (see `mat_ne`).
    """
    latitude = np.asarray(latitude, dtype=float)
    zero = np.zeros_like(latitude)
    return EARTH_RATE * np.stack([np.cos(latitude), zero, -np.sin(latitude)], axis=-1)


def mat_ne(latitude: float, longitude: float) -> NDArray[np.float64]:
    """Rotation from the Earth-fixed frame e to n, shape (3, 3) (Groves 2013, eq. 2.150).

    The paper prints the second entry of the third row of eq:3 as -cos lat cos lon; a
    rotation matrix needs -cos lat sin lon, which is what stands here.
    """
    sin_lat, cos_lat = np.sin(latitude), np.cos(latitude)
    sin_lon, cos_lon = np.sin(longitude), np.cos(longitude)
    return np.array(
        [
            [-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat],
            [-sin_lon, cos_lon, 0.0],
            [-cos_lat * cos_lon, -cos_lat * sin_lon, -sin_lat],
        ]
    )


def normal_gravity(latitude: ArrayLike, height: ArrayLike = 0.0) -> NDArray[np.float64]:
    """Normal gravity, m/s^2, at a geodetic latitude (rad) and a height (m) above the ellipsoid.

    Somigliana's formula and its second-order continuation in height (NIMA TR8350.2,
    eq. 4-1 and 4-3); below 1e-6 m/s^2 of error up to 10 km.
    """
    sin2 = np.sin(np.asarray(latitude, dtype=float)) ** 2
    surface = GRAVITY_EQUATOR * (1 + SOMIGLIANA * sin2) / np.sqrt(1 - ECCENTRICITY_SQUARED * sin2)
    ratio = np.asarray(height, dtype=float) / SEMI_MAJOR_AXIS
    return surface * (1 - 2 * (1 + FLATTENING + GRAVITY_RATIO - 2 * FLATTENING * sin2) * ratio + 3 * ratio**2)
