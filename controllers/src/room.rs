//! Places of the walls of a room of known size, although other vehicles stand in the beams.
//!
//! Along each of the heading's level axes two beams look at two walls with a known distance from each other. So
//! each beam shows the vehicle's place on the axis. An object in a beam shortens it, and the place that it shows
//! is wrong. The place is therefore carried on by the velocity and corrected by the beam that shows nearly the
//! same. A beam that shows another place is not believed, unless both show it together, which they do where they
//! see both walls. With both beams blocked the place goes on by velocity alone.

use component::messages::WallEstimate;

/// A beam this far from where its wall should be sees something else, m. Tuned, no source: above the error that
/// dead reckoning gathers along a side, below a vehicle's size and gap.
const GATE_M: f64 = 0.5;

/// Greatest difference between the places by two beams that both see walls, m. Tuned, no source.
const AGREEMENT_M: f64 = 0.15;

/// Time constant with which the place follows a beam that is believed, s. Tuned, no source: two or three
/// measurements at 10 Hz.
const FOLLOWING_S: f64 = 0.25;

/// A room, empty but for vehicles, with its walls across the heading's axes.
///
/// ```
/// use controllers::room::Room;
///
/// let room = Room { size_m: [10.0, 8.0] };
/// assert_eq!(room.distances_m(&[7.0, 3.0]), [3.0, 7.0, 5.0, 3.0], "to the walls at +x, -x, +y, -y");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Room {
    /// Distance between the walls along the heading's x, and along its y, m.
    pub size_m: [f64; 2],
}

impl Room {
    /// The distances from the walls at -x and -y by the beams, at the start of the vehicle.
    #[must_use]
    pub fn begun_m(&self, walls: &WallEstimate) -> [f64; 2] {
        std::array::from_fn(|axis| match self.beam_places_m(axis, walls) {
            [Some(a_m), Some(b_m)] if (a_m - b_m).abs() < AGREEMENT_M => 0.5 * (a_m + b_m),
            [Some(a_m), _] | [None, Some(a_m)] => a_m,
            [None, None] => 0.5 * self.size_m[axis],
        })
    }

    /// `before_m` carried on by one period.
    #[must_use]
    pub fn moved_m(&self, before_m: &[f64; 2], walls: &WallEstimate, period_s: f64) -> [f64; 2] {
        std::array::from_fn(|axis| {
            let carried_m = before_m[axis] + walls.velocity[axis] * period_s;
            let place_m = self.believed_m(axis, carried_m, walls);
            place_m.map_or(carried_m, |place_m| carried_m + (place_m - carried_m) * (period_s / FOLLOWING_S))
        })
    }

    /// The distances of the walls at +x, -x, +y, -y from a place.
    #[must_use]
    pub fn distances_m(&self, place_m: &[f64; 2]) -> [f64; 4] {
        let [x_m, y_m] = *place_m;
        [self.size_m[0] - x_m, x_m, self.size_m[1] - y_m, y_m]
    }

    fn believed_m(&self, axis: usize, carried_m: f64, walls: &WallEstimate) -> Option<f64> {
        let places = self.beam_places_m(axis, walls);
        if let [Some(a_m), Some(b_m)] = places
            && (a_m - b_m).abs() < AGREEMENT_M
        {
            return Some(0.5 * (a_m + b_m));
        }
        let near = places.into_iter().flatten().filter(|place_m| (place_m - carried_m).abs() < GATE_M);
        near.min_by(|a_m, b_m| (a_m - carried_m).abs().total_cmp(&(b_m - carried_m).abs()))
    }

    /// The place on an axis by the beam forwards along it, and by the one backwards.
    fn beam_places_m(&self, axis: usize, walls: &WallEstimate) -> [Option<f64>; 2] {
        let seen = |beam: usize| (walls.in_sight[beam] != 0).then_some(walls.distance[beam]);
        [seen(2 * axis).map(|distance_m| self.size_m[axis] - distance_m), seen(2 * axis + 1)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROOM: Room = Room { size_m: [10.0, 8.0] };

    /// Returns the estimate of walls at 7 m from the wall at -x and 3 m from that at -y.
    fn seen() -> WallEstimate {
        WallEstimate { distance: [3.0, 7.0, 5.0, 3.0], in_sight: [1; 4], ..WallEstimate::default() }
    }

    fn settled(mut place_m: [f64; 2], walls: &WallEstimate, seconds: usize) -> [f64; 2] {
        for _ in 0..1000 * seconds {
            place_m = ROOM.moved_m(&place_m, walls, 1e-3);
        }
        place_m
    }

    #[test]
    fn free_beams_tell_the_place_and_the_distances() {
        assert_eq!(ROOM.begun_m(&seen()), [7.0, 3.0]);
        assert_eq!(ROOM.distances_m(&[7.0, 3.0]), seen().distance);
    }

    #[test]
    fn a_vehicle_in_a_beam_moves_no_wall() {
        let mut walls = seen();
        walls.distance[0] = 1.2;
        assert_eq!(settled([7.0, 3.0], &walls, 3), [7.0, 3.0]);
        walls.distance[1] = 1.2;
        assert_eq!(settled([7.0, 3.0], &walls, 3), [7.0, 3.0]);
    }

    #[test]
    fn between_two_vehicles_the_place_goes_on_by_velocity() {
        let mut walls = WallEstimate { velocity: [-0.5, 0.0], ..seen() };
        (walls.distance[0], walls.distance[1]) = (1.2, 1.2);
        assert!((settled([7.0, 3.0], &walls, 2)[0] - 6.0).abs() < 1e-6);
    }

    #[test]
    fn two_beams_that_agree_correct_a_place_however_wrong() {
        let place_m = settled([2.0, 6.0], &seen(), 3);
        assert!((place_m[0] - 7.0).abs() < 1e-3 && (place_m[1] - 3.0).abs() < 1e-3);
    }

    #[test]
    fn a_wall_out_of_reach_leaves_it_to_the_other_beam() {
        let walls = WallEstimate { in_sight: [1, 0, 1, 1], distance: [2.0, 7.65, 5.0, 3.0], ..seen() };
        assert_eq!(ROOM.begun_m(&walls), [8.0, 3.0]);
        assert!((settled([7.8, 3.0], &walls, 3)[0] - 8.0).abs() < 1e-3);
    }
}
