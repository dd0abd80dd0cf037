//! Free bodies that hang from the vehicle, by the joints of their scene.

use crate::joint::{End, Freedom};
use crate::scene::Scene;

impl Scene {
    /// Tells for each of [`Scene::bodies`] whether it hangs from the vehicle, by joints to it or to others that
    /// do; the world ties nothing together.
    #[must_use]
    pub fn hanging(&self) -> Vec<bool> {
        let mut hangs = vec![false; self.bodies().count()];
        let is_in = |hangs: &[bool], end| match end {
            End::World => false,
            End::Vehicle => true,
            End::Body(number) => hangs.get(number).copied().unwrap_or_default(),
        };
        // A chain is as long as there are joints at most.
        for _ in &self.joints {
            for joint in self.joints.iter().filter(|joint| joint.parent != End::World) {
                if !is_in(&hangs, joint.parent) && !is_in(&hangs, joint.child) {
                    continue;
                }
                for end in [joint.parent, joint.child] {
                    let End::Body(number) = end else { continue };
                    hangs.iter_mut().skip(number).take(1).for_each(|hangs| *hangs = true);
                }
            }
        }
        hangs
    }

    /// True if a joint ties the vehicle.
    #[must_use]
    pub fn is_vehicle_tied(&self) -> bool {
        self.joints.iter().any(|joint| [joint.parent, joint.child].contains(&End::Vehicle))
    }

    /// The first joint other than a rope that ties the vehicle, or a body that hangs from it, to the world.
    pub(crate) fn joint_that_pins_the_vehicle(&self) -> Option<usize> {
        let hangs = self.hanging();
        self.joints.iter().position(|joint| {
            let is_rope = matches!(joint.freedom, Freedom::Rope { .. });
            let hangs = match joint.child {
                End::World => false,
                End::Vehicle => true,
                End::Body(number) => hangs.get(number).copied().unwrap_or_default(),
            };
            joint.parent == End::World && hangs && !is_rope
        })
    }
}
