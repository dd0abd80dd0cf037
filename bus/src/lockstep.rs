//! The lockstep's memory: a control segment that all processes of a run map, and by which they pace each other.
//!
//! Each party has a view of it with only the actions of that party. Every party may look. No process waits for a
//! look, and no message depends on one, so a look never disturbs a run.

mod cells;
mod clock_view;
mod live_view;
mod node_view;
mod segment;
mod states;
mod supervisor_view;
mod wait;
mod wake;
#[cfg(test)]
mod wake_model;

pub(crate) use clock_view::ClockView;
pub use live_view::LiveView;
pub(crate) use node_view::{Need, NodeView};
pub(crate) use segment::segment_bytes;
pub(crate) use states::Waited;
pub use states::{Phase, SlotState, TransferOutcome};
pub use supervisor_view::SupervisorView;

#[cfg(test)]
mod tests {
    use super::{ClockView, Need, NodeView, SupervisorView, Waited};
    use crate::names::shm_path;
    use crate::place::Place;
    use crate::plan::{InputPlan, NodePlan, OutputPlan, Plan, TopicPlan, Wait};
    use crate::sample_ticks::SampleTicks;

    /// The views of a run in which `reader` reads the topic of `sender`.
    struct Views {
        supervisor: SupervisorView,
        clock: ClockView,
        sender: NodeView,
        reader: NodeView,
    }

    const SAMPLES: Need = Need::Samples { topic: 0, input: 0 };

    fn with_views(test: impl FnOnce(&Views, &[usize])) {
        let ticks = SampleTicks::every(1);
        let topic = TopicPlan { name: "/t".to_owned(), type_name: "a/msg/B".to_owned(), ticks };
        let input = InputPlan { port: "in".to_owned(), topic: 0, delay_ticks: 0, initial: None };
        let output = OutputPlan { port: "out".to_owned(), topic: 0 };
        let sender = NodePlan::for_test("sender", vec![], vec![output]);
        let reader = NodePlan::for_test("reader", vec![input], vec![]);
        let plan = Plan::for_test(100, vec![topic], vec![sender, reader]);
        let supervisor = SupervisorView::create(&plan).unwrap();
        assert!(SupervisorView::create(&plan).is_err(), "two runs never share a segment");
        let [sender, reader] = [0, 1].map(|node| NodeView::open(&plan, node, 0, Place::Process).unwrap());
        let views =
            Views { supervisor, clock: ClockView::open(&plan, Place::Process).unwrap(), sender, reader };
        test(&views, &[plan.first_input(plan.slot(1, 0))]);
        std::fs::remove_file(shm_path(&plan.run_id, "control")).unwrap();
    }

    #[test]
    fn a_sleeper_is_woken_when_its_count_is_reached_however_it_waits() {
        with_views(|views, readers| {
            for (round, wait) in [Wait::Block, Wait::Spin, Wait::Adaptive].into_iter().enumerate() {
                let target = 1000 * (round as u32 + 1);
                std::thread::scope(|scope| {
                    let sleeper = scope.spawn(|| views.reader.wait(SAMPLES, target, wait, || false));
                    let start = views.reader.ticks_sent(0);
                    (start + 1..=target).for_each(|count| views.sender.samples_sent(0, count, readers));
                    assert_eq!(sleeper.join().unwrap(), Waited::Reached);
                });
            }
        });
    }

    #[test]
    fn two_sides_hand_over_a_hundred_thousand_times_without_losing_a_wake_up() {
        with_views(|views, readers| {
            let rounds = 100_000;
            std::thread::scope(|scope| {
                scope.spawn(|| {
                    for round in 1..=rounds {
                        views.reader.wait(SAMPLES, round, Wait::Block, || false);
                        views.reader.completed(round);
                    }
                });
                for round in 1..=rounds {
                    views.sender.samples_sent(0, round, readers);
                    views.clock.wait_done(1, round, || false);
                }
            });
            assert_eq!(views.clock.done(1), rounds);
        });
    }

    #[test]
    fn an_abort_and_an_earlier_end_wake_everybody() {
        with_views(|views, readers| {
            let Views { supervisor, clock, sender, reader } = views;
            std::thread::scope(|scope| {
                let is_over = || reader.end_tick() <= 50;
                let sleeper = scope.spawn(move || reader.wait(Need::Grant, 60, Wait::Block, is_over));
                clock.set_end_tick(50);
                assert_eq!(sleeper.join().unwrap(), Waited::Over);
                let sends = scope.spawn(|| sender.wait(Need::Grant, 1, Wait::Block, || false));
                supervisor.abort();
                assert_eq!(sends.join().unwrap(), Waited::Over);
            });
            // A node that only reads still takes samples, until no more come.
            std::thread::scope(|scope| {
                let reads = scope.spawn(|| [1, 2].map(|n| reader.wait(SAMPLES, n, Wait::Block, || false)));
                sender.samples_sent(0, 1, readers);
                supervisor.note_drained();
                assert_eq!(reads.join().unwrap(), [Waited::Reached, Waited::Over]);
            });
        });
    }
}
