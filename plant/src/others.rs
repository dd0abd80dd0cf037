//! Other vehicles of the traffic: all but the one that is where this plant's vehicle is.

use crate::backend::{Neighbour, TRAFFIC_MAX};
use crate::saved::{Reader, Saved, Unfit, Writer};
use component::messages::{Time, Traffic};
use nalgebra::Vector3;

/// The other vehicles of the run.
#[derive(Debug, Default)]
pub(crate) struct Others {
    /// This vehicle's place in the traffic, known from the first sample on.
    self_index: Option<u32>,
    /// Overwritten at every tick.
    neighbours: Vec<Neighbour>,
}

/// A place in the traffic that is not known yet, as it is saved.
const UNKNOWN: u32 = u32::MAX;

/// Traffic in which this vehicle cannot be told from the others.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(crate) enum OthersError {
    #[error(
        "none of the {count} vehicles of the first traffic is at {position_W_m:?}, where this one is; the traffic must \
         read this plant's state, without a delay and at every tick"
    )]
    Absent { count: usize, position_W_m: Vector3<f64> },
    #[error("the vehicles {first} and {second} of the traffic start at one place")]
    OnePlace { first: usize, second: usize },
}

impl Saved for Others {
    fn size(&self) -> usize {
        size_of::<u32>()
    }

    fn save(&self, to: &mut Writer<'_>) {
        self.self_index.unwrap_or(UNKNOWN).save(to);
    }

    fn load(&mut self, from: &mut Reader<'_>) -> Result<(), Unfit> {
        let mut index = UNKNOWN;
        index.load(from)?;
        if index != UNKNOWN && index as usize >= TRAFFIC_MAX {
            return Err(Unfit::Value("it is beyond the last vehicle"));
        }
        self.self_index = (index != UNKNOWN).then_some(index);
        Ok(())
    }
}

impl Others {
    pub(crate) fn new() -> Self {
        Self { self_index: None, neighbours: Vec::with_capacity(TRAFFIC_MAX) }
    }

    /// The other vehicles at `now_ns`, when this one is at `position_W_m`. A sample that is older is carried on at its
    /// velocities.
    ///
    /// # Errors
    /// If this vehicle is not among the first traffic, or two are at its place.
    pub(crate) fn seen(
        &mut self,
        traffic: &Traffic,
        position_W_m: &Vector3<f64>,
        now_ns: u64,
    ) -> Result<&[Neighbour], OthersError> {
        let count = (traffic.count as usize).min(TRAFFIC_MAX);
        let index = match self.self_index {
            Some(index) => index,
            None => *self.self_index.insert(place(traffic, count, position_W_m)? as u32),
        };
        let age_s = now_ns.saturating_sub(ns(traffic.stamp)) as f64 * 1e-9;
        self.neighbours.clear();
        self.neighbours.extend(
            (0..count)
                .filter(|number| *number != index as usize)
                .map(|number| neighbour(traffic, number, age_s)),
        );
        Ok(&self.neighbours)
    }
}

/// The one that is exactly where this vehicle is: the traffic copies the states that the plants publish.
fn place(traffic: &Traffic, count: usize, position_W_m: &Vector3<f64>) -> Result<usize, OthersError> {
    let is_here =
        |number: &usize| Vector3::from(<[f64; 3]>::from(traffic.position[*number])) == *position_W_m;
    let mut here = (0..count).filter(is_here);
    let first = here.next().ok_or(OthersError::Absent { count, position_W_m: *position_W_m })?;
    here.next().map_or(Ok(first), |second| Err(OthersError::OnePlace { first, second }))
}

fn neighbour(traffic: &Traffic, number: usize, age_s: f64) -> Neighbour {
    let vector = |v| Vector3::from(<[f64; 3]>::from(v));
    let velocity_W_m_s = vector(traffic.velocity[number]);
    let position_W_m = vector(traffic.position[number]) + velocity_W_m_s * age_s;
    Neighbour { number: number as u32, position_W_m, velocity_W_m_s }
}

fn ns(time: Time) -> u64 {
    time.sec as u64 * 1_000_000_000 + u64::from(time.nanosec)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn traffic(positions: &[[f64; 3]]) -> Traffic {
        let mut traffic = Traffic { count: positions.len() as u32, ..Default::default() };
        for (place, position) in traffic.position.iter_mut().zip(positions) {
            *place = (*position).into();
        }
        traffic.velocity = [[1.0, 0.0, 0.0].into(); TRAFFIC_MAX];
        traffic
    }

    #[test]
    fn the_vehicle_itself_is_left_out_and_the_others_keep_their_numbers() {
        let mut others = Others::new();
        let traffic = traffic(&[[0.0; 3], [1.0, 2.0, 3.0], [4.0; 3]]);
        let position_W_m = Vector3::new(1.0, 2.0, 3.0);
        let seen = others.seen(&traffic, &position_W_m, 0).unwrap();
        assert_eq!(seen.iter().map(|neighbour| neighbour.number).collect::<Vec<_>>(), [0, 2]);
        // Known by then: it need not be found again.
        let seen = others.seen(&traffic, &Vector3::zeros(), 500_000_000).unwrap();
        assert_eq!(seen[0].position_W_m, Vector3::new(0.5, 0.0, 0.0), "an older sample is carried on");
    }

    #[test]
    fn a_traffic_without_the_vehicle_or_with_two_at_its_place_is_refused() {
        let seen = |positions| Others::new().seen(&traffic(positions), &Vector3::zeros(), 0).map(<[_]>::len);
        assert!(seen(&[[1.0; 3]]).unwrap_err().to_string().contains("none of the 1 vehicles"));
        assert!(seen(&[[0.0; 3], [0.0; 3]]).unwrap_err().to_string().contains("start at one place"));
    }
}
