//! Flights in a steady wind, into which the vehicle leans while it stays where it is.

use std::fmt::Write as _;

use crate::support::Place;
use flights::{Flight, FlightsError, Quantity};
use nalgebra::{UnitQuaternion, Vector3};

const CHANNELS: &str = r#"
time = { columns = ["t"], unit = "s" }
command = { columns = ["m1", "m2", "m3", "m4"], unit = "count" }
position = { columns = ["px", "py", "pz"], unit = "m" }
attitude = { columns = ["qx", "qy", "qz", "qw"] }
angular_velocity = { columns = ["wx", "wy", "wz"], unit = "rad/s" }
"#;
/// The wind asks for a lean of 35 degrees.
const WIND_M_S2: f64 = 7.0;

/// A flight of 10 s at 100 Hz that swings along x, and by a part of that along y.
struct Wind {
    part_y: f64,
    gust_m_s2: f64,
}

impl Wind {
    fn attitude(&self, t: f64) -> UnitQuaternion<f64> {
        let along_x = -0.784 * libm::sin(1.4 * t) - 1.5 * libm::sin(5.0 * t);
        let along_y = -1.2 * libm::cos(2.0 * t) - 0.968 * libm::cos(4.4 * t);
        let wind = WIND_M_S2 + self.gust_m_s2 * libm::sin(3.3 * t + 0.5);
        let force = Vector3::new(along_x + wind, self.part_y * along_y, 9.81);
        let leaning = UnitQuaternion::rotation_between(&Vector3::z(), &force).unwrap();
        leaning * UnitQuaternion::from_euler_angles(0.0, 0.0, 0.2 * libm::sin(0.9 * t))
    }

    fn row(&self, t: f64) -> [f64; 17] {
        let x = 0.4 * libm::sin(1.4 * t) + 0.06 * libm::sin(5.0 * t);
        let y = self.part_y * (0.3 * libm::cos(2.0 * t) + 0.05 * libm::cos(4.4 * t));
        let (q, step) = (self.attitude(t), 1e-5);
        let w = (self.attitude(t - step).inverse() * self.attitude(t + step)).scaled_axis() / (2.0 * step);
        let u = q * w;
        [100.0, 101.0, 102.0, 103.0, x, y, 1.0, q.i, q.j, q.k, q.w, w.x, w.y, w.z, u.x, u.y, u.z]
    }

    /// The flight as a CSV file, with the rates along the axes of the body and of the world.
    fn csv(&self) -> String {
        let mut text = "t,m1,m2,m3,m4,px,py,pz,qx,qy,qz,qw,wx,wy,wz,ux,uy,uz\n".to_owned();
        for k in 0..=1000 {
            let t = 0.01 * f64::from(k);
            let numbers: Vec<String> = self.row(t).iter().map(f64::to_string).collect();
            writeln!(text, "{t:.2},{}", numbers.join(",")).unwrap();
        }
        text
    }

    fn read(&self, channels: &str) -> Result<Flight, FlightsError> {
        let place = Place::new();
        place.write("log.csv", self.csv().as_bytes());
        place.load("log.csv", channels, "")
    }

    /// Returns the contradictions in the flight, each with the correction that fits.
    fn findings(&self, channels: &str) -> Vec<(Quantity, String)> {
        match self.read(channels) {
            Err(FlightsError::Implausible { findings, .. }) => findings
                .into_iter()
                .map(|finding| (finding.channel, finding.fits.expect("a clear finding says what fits")))
                .collect(),
            other => panic!("{:?}", other.map(|flight| flight.notes).map_err(|error| error.to_string())),
        }
    }
}

const STEADY: Wind = Wind { part_y: 1.0, gust_m_s2: 0.0 };
/// The lean against the gusts is as large as that of the swings.
const GUSTY: Wind = Wind { part_y: 1.0, gust_m_s2: 2.4 };
/// It swings along x alone, nearly.
const ALONG_X: Wind = Wind { part_y: 0.15, gust_m_s2: 0.0 };

fn with_rates(columns: &str, keys: &str) -> String {
    let channels = CHANNELS.replace("\"wx\", \"wy\", \"wz\"", columns);
    channels.replace("\"rad/s\"", &format!("\"rad/s\"{keys}"))
}

#[test]
fn a_steady_lean_hides_no_wrong_position() {
    let negated = CHANNELS.replace("\"px\", \"py\"", "\"-px\", \"-py\"");
    let in_cm = CHANNELS.replace("unit = \"m\"", "unit = \"cm\"");
    let exchanged = CHANNELS.replace("\"px\", \"py\"", "\"py\", \"px\"");
    for wind in [STEADY, GUSTY] {
        assert_eq!(wind.read(CHANNELS).unwrap().notes, [""; 0], "gusts of {}", wind.gust_m_s2);
        for (channels, fits) in [
            (&negated, "a `-` before x and y of the position"),
            (&in_cm, "`unit = \"m\"`"),
            (&exchanged, "x and y of the position in each other's place"),
        ] {
            let found = wind.findings(channels);
            assert_eq!(found, [(Quantity::Position, fits.to_owned())], "gusts of {}", wind.gust_m_s2);
        }
    }
}

#[test]
fn rates_along_the_axes_of_the_world_are_found_and_read() {
    let world = "\"ux\", \"uy\", \"uz\"";
    let is = |channels: &str, fits: &str| {
        let found = STEADY.findings(channels);
        assert_eq!(found, [(Quantity::AngularVelocity, format!("`holds = \"{fits}\"`"))], "{channels}");
    };
    is(&with_rates(world, ""), "world");
    is(&with_rates("\"uy\", \"ux\", \"-uz\"", ", frame = \"frd-ned\""), "world");
    is(&with_rates("\"wx\", \"wy\", \"wz\"", ", holds = \"world\""), "body");
    let body = STEADY.read(CHANNELS).unwrap().angular_velocity;
    for channels in [
        with_rates(world, ", holds = \"world\""),
        with_rates("\"uy\", \"ux\", \"-uz\"", ", holds = \"world\", frame = \"frd-ned\""),
    ] {
        let flight = STEADY.read(&channels).unwrap();
        assert_eq!(
            flight.notes,
            ["angular_velocity: computed with the attitude from what is declared as world"]
        );
        assert_eq!(flight.angular_velocity.time_s, body.time_s);
        for (a, b) in flight.angular_velocity.values.iter().zip(&body.values) {
            assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9), "{a:?} {b:?}");
        }
    }
    assert_eq!(
        STEADY.read(&with_rates("\"wx\", \"wy\", \"wz\"", ", holds = \"body\"")).unwrap().notes,
        [""; 0]
    );
}

#[test]
fn axes_of_rates_are_no_kind_of_force_and_need_an_attitude() {
    let said = |channels: &str, part: &str| {
        let found = STEADY.read(channels).unwrap_err().to_string();
        assert!(found.contains(part), "`{part}` is not in: {found}");
    };
    let forces = with_rates("\"ux\", \"uy\", \"uz\"", ", holds = \"world-acceleration\"");
    said(&forces, "`holds`: expected \"body\" or \"world\", found \"world-acceleration\"");
    let rates = CHANNELS.replace("angular_velocity", "specific_force").replace("rad/s", "m/s^2");
    said(
        &rates.replace("\"m/s^2\"", "\"m/s^2\", holds = \"world\""),
        "or \"world-specific-force\", found \"world\"",
    );
    let alone =
        with_rates("\"ux\", \"uy\", \"uz\"", ", holds = \"world\"").replace("attitude =", "# attitude =");
    said(&alone, "`holds`: expected an attitude at its times");
}

/// The rates of a gyroscope in forward, right and down follow an attitude with w first, too. But they follow
/// it better with their own signs.
#[test]
fn a_gyroscope_in_another_frame_is_no_attitude_in_another_order() {
    let found = ALONG_X.findings(&with_rates("\"wx\", \"-wy\", \"-wz\"", ""));
    assert_eq!(found, [(Quantity::AngularVelocity, "`frame = \"frd-ned\"`".to_owned())]);
}

/// On a circle at constant heading, an attitude that comes late looks like rates along turned axes.
#[test]
fn a_late_attitude_on_a_circle_is_no_rate_in_the_world() {
    const LEAN_RAD: f64 = 0.1;
    const HEADING_RAD: f64 = 0.3;
    const TURN_RAD_S: f64 = 3.0;
    const LATE_S: f64 = 0.1;
    let attitude = |t: f64| {
        let force =
            Vector3::new(libm::cos(TURN_RAD_S * t), libm::sin(TURN_RAD_S * t), 1.0 / libm::tan(LEAN_RAD));
        let leaning = UnitQuaternion::rotation_between(&Vector3::z(), &force).unwrap();
        leaning * UnitQuaternion::from_euler_angles(0.0, 0.0, HEADING_RAD)
    };
    let radius_m = 9.81 * libm::tan(LEAN_RAD) / (TURN_RAD_S * TURN_RAD_S);
    let mut text = "t,m1,m2,m3,m4,px,py,pz,qx,qy,qz,qw,wx,wy,wz\n".to_owned();
    for k in 0..=1000 {
        let t = 0.01 * f64::from(k);
        let (q, step) = (attitude(t - LATE_S), 1e-5);
        let w = (attitude(t - step).inverse() * attitude(t + step)).scaled_axis() / (2.0 * step);
        let [x, y] = [-radius_m * libm::cos(TURN_RAD_S * t), -radius_m * libm::sin(TURN_RAD_S * t)];
        let numbers = [100.0, 101.0, 102.0, 103.0, x, y, 1.0, q.i, q.j, q.k, q.w, w.x, w.y, w.z];
        writeln!(text, "{t:.2},{}", numbers.map(|number| number.to_string()).join(",")).unwrap();
    }
    let place = Place::new();
    place.write("log.csv", text.as_bytes());
    let flight = place.load("log.csv", CHANNELS, "").unwrap();
    assert!(!flight.notes.iter().any(|note| note.contains("holds")), "{:?}", flight.notes);
}
