//! The five states of wall following (thesis Fig 5.36) and their directions. State 1 flies along the
//! heading's +x from the middle to the first wall. Then 2 flies along −y, 3 along −x, 4 along +y, 5 along +x,
//! then 2 again. Seen from above this is clockwise, with the wall to the left. A lap is complete where 5
//! gives way to 2.

/// One of the four beams: 0 is +x, 1 is −x, 2 is +y, 3 is −y of the heading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Beam(pub(crate) usize);

impl Beam {
    /// The heading's axis along which it looks.
    pub(crate) fn axis(self) -> usize {
        self.0 / 2
    }

    /// 1 where it looks along that axis, -1 where against it.
    pub(crate) fn sign(self) -> f64 {
        if self.0.is_multiple_of(2) { 1.0 } else { -1.0 }
    }
}

/// Direction of a state's flight, and the wall beside it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Leg {
    /// Direction of the flight.
    pub(crate) ahead: Beam,
    /// Wall beside the flight; `None` in the first state, which has none yet.
    pub(crate) beside: Option<Beam>,
}

impl Leg {
    /// The leg of a state, 1 to 5.
    pub(crate) fn of(state: u32) -> Self {
        let (ahead, beside) = match state {
            2 => (3, Some(0)),
            3 => (1, Some(3)),
            4 => (2, Some(1)),
            5 => (0, Some(2)),
            _ => (0, None),
        };
        Self { ahead: Beam(ahead), beside: beside.map(Beam) }
    }

    /// The axis across the flight.
    pub(crate) fn across(self) -> usize {
        1 - self.ahead.axis()
    }
}

/// The state behind `state`, and the laps that are complete with it.
pub(crate) fn next(state: u32, laps: u32) -> (u32, u32) {
    if state == 5 { (2, laps + 1) } else { (state + 1, laps) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wall_is_on_the_left_in_every_state_and_was_ahead_in_the_one_before() {
        for state in 2..=5 {
            let (leg, before) = (Leg::of(state), Leg::of(if state == 2 { 5 } else { state - 1 }));
            let beside = leg.beside.unwrap();
            assert_eq!(beside, before.ahead, "state {state}");
            assert_eq!(leg.across(), beside.axis());
        }
        assert_eq!(Leg::of(1), Leg { beside: None, ..Leg::of(5) });
    }
}
