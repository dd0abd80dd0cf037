//! The body of a vehicle: the parts that are seen, and the parts that touch. They are boxes, cylinders and balls in
//! the body frame (x forward, y left, z up, from the centre of mass).
//!
//! Vehicle files give only the places of the rotors. The radius of the propellers, the disc and the feet are those of
//! the [`Hull`] with which a vehicle touches the world; the other parts are scaled with the longest arm.

use nalgebra::{Matrix3, Vector3};
use plant::Airframe;
use plant::contact_dynamics::hull::Hull;

/// Height of the hub: as thick as the disc that touches. The following are parts of the longest arm: tuned, no source.
const ARM_RADIUS: f64 = 0.03;
/// Radius of a motor.
const MOTOR_RADIUS: f64 = 0.08;
/// Thickness of a propeller's disc.
const PROPELLER_THICKNESS: f64 = 0.012;
/// Radius of the struts between hub and feet.
const STRUT_RADIUS: f64 = 0.018;
/// Edges of the nose, the box at the hub's front.
const NOSE: [f64; 3] = [0.15, 0.1, 0.1];
/// An arm that leads forward by more than this part of the longest belongs to the front: the arms of an X do, and of those of
/// a plus one. Tuned, no source.
const FRONT: f64 = 0.38;
/// Corners that stand for the circle of a propeller in an outline: tuned, no source.
const CORNERS: u32 = 24;

/// Shape of a part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// A box with these edges along its own axes, in metres.
    Box([f64; 3]),
    /// A cylinder along its own z axis.
    Cylinder {
        /// Radius in metres.
        radius_m: f64,
        /// Length in metres.
        length_m: f64,
    },
    /// A ball with this radius in metres.
    Ball(f64),
}

/// Colour of a part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Paint {
    /// The frame.
    Frame,
    /// The front.
    Front,
    /// A propeller that turns counter-clockwise, seen from above.
    CounterClockwise,
    /// A propeller that turns clockwise, seen from above.
    Clockwise,
}

/// A part of a vehicle, seen or touching.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// Name; the rotors' parts begin with the rotor's name in the vehicle file.
    pub name: String,
    /// Its shape.
    pub shape: Shape,
    /// Its middle in the body frame, in metres.
    pub centre_B_m: Vector3<f64>,
    /// Its orientation in the body frame, in rad: rotations about the fixed axes x, y and z, one after another.
    pub roll_pitch_yaw_rad: [f64; 3],
    /// Its colour.
    pub paint: Paint,
}

/// A vehicle with its seen and its touching parts.
///
/// ```
/// use report::airframe::Body;
///
/// let vehicle = vehicles::Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap();
/// let body = Body::of(&plant::Airframe::new(vehicle)).unwrap();
/// let front = body.seen.iter().find(|part| part.name == "front propeller").unwrap();
/// assert_eq!(front.centre_B_m, nalgebra::Vector3::new(0.17, 0.0, 0.0));
/// assert!((body.propeller_radius_m - 0.1016).abs() < 1e-12);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// Name of the vehicle.
    pub name: String,
    /// Mass in kg.
    pub mass_kg: f64,
    /// Tensor of inertia about the centre of mass, in kg·m², in the body frame.
    pub inertia_B_kg_m2: Matrix3<f64>,
    /// Radius of its propellers, in metres.
    pub propeller_radius_m: f64,
    /// Parts that are seen.
    pub seen: Vec<Part>,
    /// Parts that touch: those of the backend `rapier`.
    pub touching: Vec<Part>,
    centre_B_m: Vector3<f64>,
    rotors_B_m: Vec<Vector3<f64>>,
    reach_m: f64,
}

impl Body {
    /// The body of a vehicle as it flies, its effects included; `None` if all rotors are in one place, which gives
    /// the vehicle no size.
    #[must_use]
    pub fn of(airframe: &Airframe) -> Option<Self> {
        let (vehicle, hull) = (airframe.vehicle(), Hull::of(airframe));
        let rotors_B_m: Vec<_> = vehicle.rotors.iter().map(|rotor| rotor.position_m).collect();
        let arm_m =
            rotors_B_m.iter().map(|at_B_m| (at_B_m - hull.centre_B_m).xy().norm()).fold(0.0, f64::max);
        if arm_m <= 0.0 {
            return None;
        }
        let size = Size { hull, arm_m, propeller_radius_m: hull.disc_radius_m - arm_m };
        let rotors = vehicle.rotors.iter().flat_map(|rotor| size.rotor(rotor));
        Some(Self {
            name: vehicle.name.clone(),
            mass_kg: vehicle.mass_kg,
            inertia_B_kg_m2: vehicle.inertia_kg_m2,
            propeller_radius_m: size.propeller_radius_m,
            seen: size.middle().into_iter().chain(rotors).chain(size.legs()).collect(),
            touching: touching(&hull),
            centre_B_m: hull.centre_B_m,
            rotors_B_m,
            reach_m: hull.disc_radius_m,
        })
    }

    /// Lines that show the body where it is small, in the body frame, in metres: an arm to each rotor, the circle of
    /// its propeller, and a line to the front that is longer than the arms.
    #[must_use]
    pub fn outline_B_m(&self) -> Vec<Vec<Vector3<f64>>> {
        let circle = |at_B_m: &Vector3<f64>| {
            let corner = |index: u32| {
                let (sin, cos) = libm::sincos(std::f64::consts::TAU * f64::from(index) / f64::from(CORNERS));
                at_B_m + self.propeller_radius_m * Vector3::new(cos, sin, 0.0)
            };
            (0..=CORNERS).map(corner).collect()
        };
        let arms = self.rotors_B_m.iter().map(|at_B_m| vec![self.centre_B_m, *at_B_m]);
        let nose = vec![self.centre_B_m, self.centre_B_m + self.reach_m * Vector3::x()];
        arms.chain(self.rotors_B_m.iter().map(circle)).chain([nose]).collect()
    }

    /// Distance to which its propellers reach from the middle of its rotors, in metres.
    #[must_use]
    pub fn reach_m(&self) -> f64 {
        self.reach_m
    }
}

/// Measures for the sizes of the parts.
struct Size {
    hull: Hull,
    arm_m: f64,
    propeller_radius_m: f64,
}

impl Size {
    /// Hub and nose.
    fn middle(&self) -> [Part; 2] {
        // As wide as the feet stand apart: the body that they belong to.
        let width_m = self.hull.feet_B_m[0].x - self.hull.feet_B_m[2].x;
        let hub = Part::upright(
            "hub",
            Shape::Box([width_m, width_m, 2.0 * self.hull.disc_half_m]),
            self.hull.centre_B_m,
        );
        let nose_m = NOSE.map(|part| part * self.arm_m);
        let ahead_m = (width_m + nose_m[0]) / 2.0;
        let nose = Part {
            paint: Paint::Front,
            ..Part::upright("nose", Shape::Box(nose_m), self.hull.centre_B_m + ahead_m * Vector3::x())
        };
        [hub, nose]
    }

    /// Arm, motor and propeller: the propeller turns at the rotor's place, on top of the motor, which stands on the arm's end.
    fn rotor(&self, rotor: &vehicles::Rotor) -> Vec<Part> {
        let Self { hull, arm_m, propeller_radius_m } = self;
        let name = |part: &str| format!("{} {part}", rotor.name);
        let is_front = rotor.position_m.x - hull.centre_B_m.x > FRONT * arm_m;
        let paint = if is_front { Paint::Front } else { Paint::Frame };
        let radius_m = ARM_RADIUS * arm_m;
        // Within the disc that touches.
        let below_m = (hull.disc_half_m - radius_m).max(0.0) * Vector3::z();
        let arm = rod(&name("arm"), hull.centre_B_m - below_m, rotor.position_m - below_m, radius_m);
        let height_m = hull.disc_half_m;
        let motor = Part {
            paint,
            ..Part::upright(
                &name("motor"),
                Shape::Cylinder { radius_m: MOTOR_RADIUS * arm_m, length_m: height_m },
                rotor.position_m - height_m / 2.0 * Vector3::z(),
            )
        };
        let shape = Shape::Cylinder { radius_m: *propeller_radius_m, length_m: PROPELLER_THICKNESS * arm_m };
        let turns = if rotor.spin > 0.0 { Paint::CounterClockwise } else { Paint::Clockwise };
        let propeller = Part {
            paint: turns,
            roll_pitch_yaw_rad: leaning(&rotor.axis),
            ..Part::upright(&name("propeller"), shape, rotor.position_m)
        };
        arm.map(|arm| Part { paint, ..arm }).into_iter().chain([motor, propeller]).collect()
    }

    /// Feet, and struts that lead to them from the hub's corners; the struts do not touch.
    fn legs(&self) -> Vec<Part> {
        let Self { hull, arm_m, .. } = self;
        let leg = |(number, foot_B_m): (usize, &Vector3<f64>)| {
            let top_B_m = Vector3::new(foot_B_m.x, foot_B_m.y, hull.centre_B_m.z);
            let strut = rod(&format!("strut {number}"), top_B_m, *foot_B_m, STRUT_RADIUS * arm_m);
            let foot = Part::upright(&format!("foot {number}"), Shape::Ball(hull.foot_radius_m), *foot_B_m);
            strut.into_iter().chain([foot])
        };
        (1..).zip(&hull.feet_B_m).flat_map(leg).collect()
    }
}

impl Part {
    /// A part of the frame that is not turned.
    fn upright(name: &str, shape: Shape, centre_B_m: Vector3<f64>) -> Self {
        Self { name: name.to_owned(), shape, centre_B_m, roll_pitch_yaw_rad: [0.0; 3], paint: Paint::Frame }
    }
}

/// A cylinder from one place to another; nothing where that is the same one.
fn rod(name: &str, from_B_m: Vector3<f64>, to_B_m: Vector3<f64>, radius_m: f64) -> Option<Part> {
    let along_B_m = to_B_m - from_B_m;
    let length_m = along_B_m.norm();
    let shape = Shape::Cylinder { radius_m, length_m };
    let part = Part {
        roll_pitch_yaw_rad: leaning(&along_B_m),
        ..Part::upright(name, shape, (from_B_m + to_B_m) / 2.0)
    };
    (length_m > 0.0).then_some(part)
}

/// The turn (rad) that takes body z to the direction `along_B`: about y first, then about z, which takes z to
/// (cos yaw sin pitch, sin yaw sin pitch, cos pitch).
fn leaning(along_B: &Vector3<f64>) -> [f64; 3] {
    let pitch_rad = libm::atan2(along_B.xy().norm(), along_B.z);
    [0.0, pitch_rad, libm::atan2(along_B.y, along_B.x)]
}

/// The disc and the four balls that the backend `rapier` touches the world with.
fn touching(hull: &Hull) -> Vec<Part> {
    let shape = Shape::Cylinder { radius_m: hull.disc_radius_m, length_m: 2.0 * hull.disc_half_m };
    let disc = Part::upright("disc", shape, hull.centre_B_m);
    let foot = |(number, foot_B_m): (usize, &Vector3<f64>)| {
        Part::upright(&format!("foot {number}"), Shape::Ball(hull.foot_radius_m), *foot_B_m)
    };
    std::iter::once(disc).chain((1..).zip(&hull.feet_B_m).map(foot)).collect()
}

#[cfg(test)]
mod tests {
    use super::{Body, Paint, Part, Shape};
    use nalgebra::{Rotation3, Vector3};
    use plant::Airframe;
    use vehicles::Vehicle;

    fn body(change: impl FnOnce(&mut Vehicle)) -> Option<Body> {
        let mut vehicle = Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap();
        change(&mut vehicle);
        Body::of(&Airframe::new(vehicle))
    }

    /// The ends of a cylinder.
    fn ends(part: &Part) -> [Vector3<f64>; 2] {
        let Shape::Cylinder { length_m, .. } = part.shape else { panic!("{part:?}") };
        let [roll, pitch, yaw] = part.roll_pitch_yaw_rad;
        let half_m = Rotation3::from_euler_angles(roll, pitch, yaw) * Vector3::z() * length_m / 2.0;
        [part.centre_B_m - half_m, part.centre_B_m + half_m]
    }

    #[test]
    fn every_arm_leads_from_the_middle_to_below_its_rotor_wherever_that_is() {
        let places_m = [[0.2, 0.1, 0.05], [0.1, -0.2, -0.03], [-0.3, 0.0, 0.0], [-0.1, 0.25, 0.01]];
        let body = body(|vehicle| {
            for (rotor, at_m) in vehicle.rotors.iter_mut().zip(places_m) {
                rotor.position_m = at_m.into();
            }
        });
        let body = body.unwrap();
        let middle_m = places_m.iter().map(|at_m| Vector3::from(*at_m)).sum::<Vector3<f64>>() / 4.0;
        for (name, at_m) in ["front", "right", "rear", "left"].iter().zip(places_m) {
            let arm = body.seen.iter().find(|part| part.name == format!("{name} arm")).unwrap();
            let [from_m, to_m] = ends(arm).map(|end| end.xy());
            assert!((from_m - middle_m.xy()).norm() < 1e-12, "{name}: {from_m}");
            assert!((to_m - Vector3::from(at_m).xy()).norm() < 1e-12, "{name}: {to_m}");
        }
    }

    #[test]
    fn the_front_and_the_senses_of_rotation_are_told_by_colours() {
        let body = body(|_| ()).unwrap();
        let paint = |name: &str| body.seen.iter().find(|part| part.name == name).unwrap().paint;
        assert_eq!(
            (paint("nose"), paint("front arm"), paint("front motor")),
            (Paint::Front, Paint::Front, Paint::Front)
        );
        for name in ["left", "right", "rear"] {
            assert_eq!(paint(&format!("{name} arm")), Paint::Frame, "{name}");
        }
        assert_eq!((paint("front propeller"), paint("rear propeller")), (Paint::Clockwise, Paint::Clockwise));
        let sides = (paint("left propeller"), paint("right propeller"));
        assert_eq!(sides, (Paint::CounterClockwise, Paint::CounterClockwise));
    }

    #[test]
    fn what_is_seen_of_a_rotor_is_within_what_touches() {
        let body = body(|_| ()).unwrap();
        let Shape::Cylinder { radius_m, length_m } = body.touching[0].shape else { panic!() };
        for part in body.seen.iter().filter(|part| part.name.contains("arm") || part.name.contains("motor")) {
            let Shape::Cylinder { radius_m: own_m, .. } = part.shape else { panic!("{part:?}") };
            for end_m in ends(part) {
                assert!(end_m.xy().norm() + own_m <= radius_m, "{part:?}");
                assert!(end_m.z.abs() <= length_m / 2.0 + 1e-12, "{part:?}");
            }
        }
    }

    #[test]
    fn a_vehicle_with_its_rotors_in_one_place_has_no_size() {
        let none =
            body(|vehicle| vehicle.rotors.iter_mut().for_each(|rotor| rotor.position_m = Vector3::zeros()));
        assert!(none.is_none());
    }

    #[test]
    fn an_outline_shows_the_front() {
        let body = body(|_| ()).unwrap();
        let lines = body.outline_B_m();
        assert_eq!(lines.len(), 9);
        let ahead_m = lines[8][1];
        assert!((ahead_m.x - body.reach_m()).abs() < 1e-12 && ahead_m.y == 0.0);
        assert!((lines[4][0] - lines[4][24]).norm() < 1e-12, "the circle is closed");
    }
}
