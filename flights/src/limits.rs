//! Limits of a flight that is proposed: the table `next_flight` of a flights file.

use serde::Deserialize;

/// Limits that a proposed flight keeps. A limit that is absent is the one that the measured flights reached.
///
/// ```
/// let text = "room_m = [[-2, 2], [-2, 2], [0.5, 3]]\nspeed_max_m_s = 3\ntilt_max_deg = 30\nduration_s = 40";
/// let limits: flights::NextFlight = toml::from_str(text)?;
/// assert_eq!((limits.room_m.unwrap()[2], limits.duration_s), ([0.5, 3.0], Some(40.0)));
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NextFlight {
    /// Least and greatest position along x, y and z of the world, in m.
    pub room_m: Option<[[f64; 2]; 3]>,
    /// Greatest speed in m/s.
    pub speed_max_m_s: Option<f64>,
    /// Greatest angle between the body's z and the vertical, in degrees.
    pub tilt_max_deg: Option<f64>,
    /// Length of the flight in s.
    pub duration_s: Option<f64>,
}

/// Key, expected and found value of the first limit that no flight can keep.
pub(crate) type Refusal = (&'static str, &'static str, String);

impl NextFlight {
    /// The first limit that no flight can keep.
    pub(crate) fn refusal(&self) -> Option<Refusal> {
        let is_range = |[low, high]: &[f64; 2]| low.is_finite() && high.is_finite() && low < high;
        let room = self.room_m.filter(|room| !(room.iter().all(is_range) && room[2][0] >= 0.0));
        let outside = |limit: Option<f64>, most: f64| limit.filter(|limit| !(*limit > 0.0 && *limit <= most));
        let of = |key, expected, found: Option<f64>| found.map(|found| (key, expected, found.to_string()));
        let expected = "[[x_min, x_max], [y_min, y_max], [z_min, z_max]] in m, each rising, z_min at least 0";
        room.map(|room| ("room_m", expected, format!("{room:?}")))
            .or_else(|| of("speed_max_m_s", "more than 0, at most 50 m/s", outside(self.speed_max_m_s, 50.0)))
            .or_else(|| of("tilt_max_deg", "more than 0, at most 80 deg", outside(self.tilt_max_deg, 80.0)))
            .or_else(|| of("duration_s", "more than 0, at most 600 s", outside(self.duration_s, 600.0)))
    }
}

#[cfg(test)]
mod tests {
    use super::NextFlight;

    #[test]
    fn limits_that_no_flight_can_keep_are_refused_by_name() {
        let refused = |text: &str| toml::from_str::<NextFlight>(text).unwrap().refusal().map(|it| it.0);
        for (text, key) in [
            ("room_m = [[1, -1], [-1, 1], [0, 2]]", "room_m"),
            ("room_m = [[-1, 1], [-1, 1], [-1, 2]]", "room_m"),
            ("speed_max_m_s = 0", "speed_max_m_s"),
            ("tilt_max_deg = 95", "tilt_max_deg"),
            ("duration_s = nan", "duration_s"),
        ] {
            assert_eq!(refused(text), Some(key), "{text}");
        }
        assert_eq!(refused("room_m = [[-1, 1], [-1, 1], [0, 2]]\ntilt_max_deg = 30"), None);
    }
}
