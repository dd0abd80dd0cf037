//! The place on the earth at which the world's origin lies: its x points east, its y north.

use diagnostics::parameter::within;

/// Metres of a degree of latitude on a sphere of the earth's mean radius, 6 371 008.8 m (IUGG).
const M_PER_DEGREE: f64 = 6_371_008.8 * std::f64::consts::PI / 180.0;

/// Latitude, longitude and altitude of the world's origin; by default the home position of PX4's simulations, in Zurich.
///
/// ```
/// let origin = autopilots::origin::Origin::default();
/// let [longitude_deg, latitude_deg, altitude_m] = origin.place([0.0, 111.195, 2.0]);
/// assert!((latitude_deg - origin.latitude_deg - 1e-3).abs() < 1e-8, "north is along y");
/// assert_eq!((longitude_deg, altitude_m), (origin.longitude_deg, origin.altitude_m + 2.0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, bus::Parameters)]
#[parameters(default)]
pub struct Origin {
    /// Latitude, north.
    #[parameter(default = 47.397_742, check = within(-89.0..=89.0, "-89 to 89: at the poles there is no east"))]
    pub latitude_deg: f64,
    /// Longitude, east.
    #[parameter(default = 8.545_594, check = within(-180.0..=180.0, "-180 to 180"))]
    pub longitude_deg: f64,
    /// Altitude above the sea.
    #[parameter(default = 488.0, check = within(-10_000.0..=10_000.0, "-10 000 to 10 000"))]
    pub altitude_m: f64,
}

impl Origin {
    /// Longitude and latitude in degrees and altitude in metres of a position in the world, in metres: on a sphere, about the
    /// origin.
    #[must_use]
    pub fn place(&self, position_W_m: [f64; 3]) -> [f64; 3] {
        let [east_m, north_m, up_m] = position_W_m;
        let parallel = M_PER_DEGREE * libm::cos(self.latitude_deg.to_radians());
        [
            self.longitude_deg + east_m / parallel,
            self.latitude_deg + north_m / M_PER_DEGREE,
            self.altitude_m + up_m,
        ]
    }
}
