//! Connections of a node to its run: they follow the membership.

use crate::claim::Claim;
use crate::error::BusError;
use crate::lockstep::NodeView;
use crate::membership::{Membership, NodeInstances};
use crate::plan::{GroupPlan, NodePlan, Plan};
use crate::port::{InPort, OutPort, Source};
use crate::profile::TickWriter;
use crate::sample_ring::SampleRing;
use crate::transport::{Receiver, Sender, Transport};
use std::io::ErrorKind;
use std::path::PathBuf;
use std::rc::Rc;

/// Connections of a node to its run.
#[derive(Debug)]
pub(crate) struct Links {
    pub(crate) run_dir: PathBuf,
    pub(crate) plan: Plan,
    pub(crate) index: usize,
    pub(crate) generation: u32,
    pub(crate) node: NodePlan,
    pub(crate) lockstep: NodeView,
    pub(crate) transport: Rc<Transport>,
    pub(crate) _claim: Claim,
}

impl Links {
    /// Writer of the host times of the ticks from `first_tick` on, if the run is profiled.
    pub(crate) fn tick_writer(&self, first_tick: u32) -> Result<Option<TickWriter>, BusError> {
        let create =
            || TickWriter::create(&self.run_dir, &self.plan, self.index, self.generation, first_tick);
        self.plan.profile.then(create).transpose()
    }

    pub(crate) fn subscriber(&self, topic: usize, generation: u32) -> Result<Receiver, BusError> {
        self.transport.subscriber(&self.plan.topics[topic].name, generation, self.plan.capacity(topic))
    }

    /// The group that this process is, if it is one.
    fn group(&self) -> Option<&GroupPlan> {
        if self.generation == 0 { self.plan.group_of(self.index) } else { None }
    }

    /// True if the instance `generation` of `node` shares this process.
    pub(crate) fn is_member(&self, node: usize, generation: u32) -> bool {
        generation == 0 && self.group().is_some_and(|group| group.has(node))
    }

    /// True if a member of the group that this process is reads `topic`.
    pub(crate) fn has_local_readers(&self, topic: usize) -> bool {
        let reads = |node: usize| self.plan.nodes[node].inputs.iter().any(|input| input.topic == topic);
        self.group().is_some_and(|group| group.members.iter().any(|member| reads(member.node)))
    }

    /// The processes of the node that publishes `topic`.
    pub(crate) fn publisher<'a>(&self, membership: &'a Membership, topic: usize) -> &'a NodeInstances {
        &membership.nodes[self.plan.publisher(topic)]
    }

    /// True if an instance in another process reads `topic`, but for a recorder that reads the ring of the topic.
    pub(crate) fn is_read_outside(&self, membership: &Membership, topic: usize) -> bool {
        let reads_ring = |node: usize| self.group().is_some() && self.plan.nodes[node].is_recorder;
        let mut readers = membership.readers(topic);
        readers.any(|(node, generation, _)| !self.is_member(node, generation) && !reads_ring(node))
    }

    /// True if a recorder in another process reads `topic`, and this process is a group.
    pub(crate) fn is_recorded(&self, topic: usize) -> bool {
        let reads = |node: &NodePlan| node.inputs.iter().any(|input| input.topic == topic);
        self.group().is_some() && self.plan.nodes.iter().any(|node| node.is_recorder && reads(node))
    }

    /// True if samples of `topic`, which a member of the group that this process is sends, must outlive the process: when
    /// it dies, other processes go on in the places of members, and read them.
    pub(crate) fn must_outlive(&self, topic: usize) -> bool {
        let touches = |node: &NodePlan| {
            let reads = node.inputs.iter().any(|input| input.topic == topic);
            node.restarts && (reads || node.outputs.iter().any(|output| output.topic == topic))
        };
        self.group()
            .is_some_and(|group| group.members.iter().any(|member| touches(&self.plan.nodes[member.node])))
    }

    /// Ring with the samples of `topic` that a group has left behind, for a process that goes on in the place of a member;
    /// `None` if there is none.
    ///
    /// # Errors
    /// If there is one, and it cannot be read.
    pub(crate) fn left_behind(&self, topic: usize, size: usize) -> Result<Option<SampleRing>, BusError> {
        let is_of_group = self.plan.group_of(self.plan.publisher(topic)).is_some();
        if self.generation == 0 || !is_of_group {
            return Ok(None);
        }
        match SampleRing::open(&self.plan, topic, size) {
            // A topic that only processes outside the group read has no ring.
            Err(BusError::File { source, .. }) if source.kind() == ErrorKind::NotFound => Ok(None),
            opened => opened.map(Some),
        }
    }

    /// True if this process records instance `generation` of the publisher of `topic`, which is a member of a group.
    pub(crate) fn records_member(&self, topic: usize, generation: u32) -> bool {
        let publisher = self.plan.publisher(topic);
        self.node.is_recorder && generation == 0 && self.plan.group_of(publisher).is_some()
    }

    /// True if an instance in another process reads `topic` and sends something itself: others wait for it.
    pub(crate) fn is_awaited_outside(&self, membership: &Membership, topic: usize) -> bool {
        membership.readers(topic).any(|(node, generation, _)| {
            let sends = membership.nodes[node].of(generation).is_some_and(|it| !it.plan.outputs.is_empty());
            sends && !self.is_member(node, generation)
        })
    }

    /// The sending end of `topic`, whose messages have `size` bytes.
    pub(crate) fn sender(&self, topic: usize, size: usize) -> Result<Sender, BusError> {
        let capacity = self.plan.capacity(topic);
        self.transport.publisher(&self.plan.topics[topic].name, self.generation, size, capacity)
    }

    /// The inputs that read `topic`, by their numbers among those of all slots.
    pub(crate) fn readers(&self, membership: &Membership, topic: usize) -> Vec<usize> {
        let readers = membership.readers(topic);
        let number =
            |(node, generation, input)| self.plan.first_input(self.plan.slot(node, generation)) + input;
        readers.map(number).collect()
    }

    /// Connects `input` to the process that shadows its publisher, and lets go of one that is gone.
    pub(crate) fn connect_backup(
        &self,
        input: &mut InPort,
        membership: &Membership,
        tick: u32,
    ) -> Result<(), BusError> {
        let publisher = self.publisher(membership, input.topic);
        let Some(backup) = &publisher.backup else {
            input.drop_backups_beyond(publisher.primary.generation);
            return Ok(());
        };
        let take_over_tick = publisher.topic_take_over_tick(input.topic);
        if input.newest_generation() != backup.generation {
            let receiver = self.subscriber(input.topic, backup.generation)?;
            let first_tick = if backup.shadows { backup.join_tick } else { take_over_tick };
            let ticks = self.plan.topics[input.topic].ticks;
            // A reader that joined later than the shadow starts with the sample that its own first tick reads.
            let first_tick = first_tick.max(tick.saturating_sub(input.delay_ticks));
            let source = Source::new(backup.generation, receiver, first_tick, ticks);
            input.drop_backups_beyond(publisher.primary.generation);
            input.add_backup(source, backup.shadows);
        }
        input.set_take_over_tick(take_over_tick);
        Ok(())
    }

    /// Makes the samples of `output` count from the take-over on, also those that were sent already.
    pub(crate) fn promote(&self, output: &mut OutPort, instances: &NodeInstances, index: usize, tick: u32) {
        output.counts_from = instances.take_over_ticks[index];
        let shadows = instances.backup.as_ref().is_some_and(|backup| backup.shadows);
        output.sends_from = if shadows { 0 } else { output.counts_from };
        let next_due = output.ticks.next(tick);
        if next_due > output.counts_from && self.lockstep.ticks_sent(output.topic) < next_due {
            self.lockstep.samples_sent(output.topic, next_due, &output.readers);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Links;
    use crate::lockstep::{NodeView, SupervisorView};
    use crate::names::{process_name, shm_prefix};
    use crate::place::Place;
    use crate::plan::{GroupPlan, MemberPlan, NodePlan, OutputPlan, Plan, TopicPlan};
    use crate::sample_ring::SampleRing;
    use crate::sample_ticks::SampleTicks;
    use crate::transport::Transport;
    use std::rc::Rc;

    const SIZE: usize = 12;
    /// Topic of the member of the group.
    const MEMBERS: usize = 0;
    /// Topic of the node outside.
    const OUTSIDERS: usize = 1;

    /// A run with a group of one sender and a sender outside; its files in shared memory are removed with it.
    struct Run {
        folder: tempfile::TempDir,
        plan: Plan,
        _segment: SupervisorView,
    }

    impl Run {
        fn new() -> Self {
            let topic = |name: &str| TopicPlan {
                name: name.to_owned(),
                type_name: "test_msgs/msg/State".to_owned(),
                ticks: SampleTicks::every(1),
            };
            let sender = |name, topic| {
                NodePlan::for_test(name, vec![], vec![OutputPlan { port: "state".to_owned(), topic }])
            };
            let topics = vec![topic("/member/state"), topic("/outsider/state")];
            let nodes = vec![sender("member", MEMBERS), sender("outsider", OUTSIDERS)];
            let mut plan = Plan::for_test(100, topics, nodes);
            let members = vec![MemberPlan { node: 0, kind: "sender".to_owned() }];
            plan.groups = vec![GroupPlan { name: "group".to_owned(), members, cpu: None }];
            let segment = SupervisorView::create(&plan).unwrap();
            Self { folder: tempfile::tempdir().unwrap(), plan, _segment: segment }
        }

        /// Connections of the instance `generation` of the member.
        fn links(&self, generation: u32) -> Links {
            let (run_dir, name) = (self.folder.path(), process_name("member", generation));
            let transport = Transport::new(run_dir, &self.plan.run_id, &name, &Place::Process).unwrap();
            Links {
                run_dir: run_dir.to_owned(),
                plan: self.plan.clone(),
                index: 0,
                generation,
                node: self.plan.nodes[0].clone(),
                lockstep: NodeView::open(&self.plan, 0, generation, Place::Process).unwrap(),
                transport: Rc::new(transport),
                _claim: crate::claim::claim(run_dir, &name).unwrap(),
            }
        }
    }

    impl Drop for Run {
        fn drop(&mut self) {
            let prefix = shm_prefix(&self.plan.run_id);
            let files = std::fs::read_dir("/dev/shm").into_iter().flatten().flatten();
            let ours = files.filter(|file| file.file_name().to_string_lossy().starts_with(&prefix));
            ours.for_each(|file| drop(std::fs::remove_file(file.path())));
        }
    }

    #[test]
    fn a_successor_of_a_member_finds_the_samples_that_the_group_left_behind() {
        let run = Run::new();
        let successor = run.links(1);
        let mut ring = SampleRing::create(&run.plan, MEMBERS, SIZE).unwrap();
        ring.store(3, &[7, 8, 9]);
        drop(ring);
        let left = successor.left_behind(MEMBERS, SIZE).unwrap().unwrap();
        assert_eq!((left.at(3), left.at(4)), (Some(&[7, 8, 9][..]), None));
        // A ring for messages of another size is refused.
        let error = successor.left_behind(MEMBERS, 10 * SIZE).unwrap_err().to_string();
        assert!(error.contains("samples_0"), "{error}");
    }

    #[test]
    fn nothing_is_left_behind_without_a_ring_a_group_or_a_predecessor() {
        let run = Run::new();
        let (first, successor) = (run.links(0), run.links(1));
        let finds = |links: &Links, topic| links.left_behind(topic, SIZE).unwrap().is_some();
        assert!(!finds(&successor, MEMBERS), "the group has made no ring");
        for topic in [MEMBERS, OUTSIDERS] {
            SampleRing::create(&run.plan, topic, SIZE).unwrap();
        }
        assert!(finds(&successor, MEMBERS));
        assert!(!finds(&first, MEMBERS), "the first instance has no predecessor");
        assert!(!finds(&successor, OUTSIDERS), "its publisher is in no group");
    }
}
