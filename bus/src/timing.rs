//! A node whose steps take simulated time: its outputs are sent when a step is done, and steps that are due meanwhile
//! are skipped.
//!
//! The step under way is kept in words behind the component's state, so that a process that takes the node's place
//! goes on with it. The words hold the tick at which the step is done, then for each output the sample sent and the
//! next one.

use crate::computing_time::ComputingTime;
use crate::error::BusError;
use crate::plan::{NodePlan, Plan};
use crate::port::OutPort;
use crate::random::{Stream, stream};

/// Words in front of the samples.
const HEAD_WORDS: usize = 2;
/// The tick at which the step under way is done, plus one; 0 if there is none.
const DONE: usize = 0;
/// 1 from the first sample on.
const HAS_SENT: usize = 1;
/// Words of the random stream that belong to a tick, as a power of two: more than any distribution draws.
const TICK_WORDS_LOG2: u32 = 8;

/// The simulated computing time of a node.
#[derive(Debug)]
pub(crate) struct Timing {
    time: ComputingTime,
    random: Stream,
    tick_ns: u64,
    period_ticks: u32,
}

/// Treatment of a due tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Due {
    /// It is computed.
    Step,
    /// The step before is under way: no inputs are read and nothing is computed.
    Skipped,
}

impl Timing {
    /// The timing of `node`, if its steps take time.
    pub(crate) fn of(plan: &Plan, node: &NodePlan) -> Option<Self> {
        let time = node.computing_time.clone()?;
        // No node has a space in its name: no other node has this stream.
        let random = stream(plan.seed, &format!("{} computing time", node.name));
        Some(Self { time, random, tick_ns: plan.tick_ns, period_ticks: node.period_ticks })
    }

    /// Words that a node with `outputs` needs behind its state.
    pub(crate) fn words(outputs: &[OutPort]) -> usize {
        HEAD_WORDS + 2 * outputs.iter().map(OutPort::sample_words).sum::<usize>()
    }

    /// Makes the outputs of a step that is done by `tick` the ones to send; returns whether the node steps.
    pub(crate) fn begin(&self, tick: u32, words: &mut [u64], outputs: &[OutPort]) -> Due {
        match words[DONE] {
            0 => Due::Step,
            done if done > u64::from(tick) + 1 => Due::Skipped,
            _ => {
                words[DONE] = 0;
                let mut rest = &mut words[HEAD_WORDS..];
                for output in outputs {
                    let [sent, next] = next_samples(&mut rest, output);
                    sent.copy_from_slice(next);
                }
                Due::Step
            }
        }
    }

    /// Takes the samples that the step at `tick` wrote, to be sent when it is done; true if that is beyond the next
    /// due tick. The first step of all is done at once: before it there is no sample to send.
    pub(crate) fn end(
        &mut self,
        tick: u32,
        words: &mut [u64],
        outputs: &mut [OutPort],
        node: &str,
    ) -> Result<bool, BusError> {
        self.random.set_word_pos(u128::from(tick) << TICK_WORDS_LOG2);
        let drawn = self.time.ticks(&mut self.random, self.tick_ns);
        let ticks = if words[HAS_SENT] == 0 { 0 } else { drawn };
        words[HAS_SENT] = 1;
        words[DONE] = if ticks == 0 { 0 } else { u64::from(tick) + u64::from(ticks) + 1 };
        let mut rest = &mut words[HEAD_WORDS..];
        for output in outputs {
            let [sent, next] = next_samples(&mut rest, output);
            if let Some(written) = output.written(tick, node)? {
                next.copy_from_slice(written);
            }
            if ticks == 0 {
                sent.copy_from_slice(next);
            }
        }
        Ok(ticks > self.period_ticks)
    }

    /// Writes the samples that are due at `tick`.
    pub(crate) fn write(
        tick: u32,
        words: &mut [u64],
        outputs: &mut [OutPort],
        node: &str,
    ) -> Result<(), BusError> {
        let mut rest = &mut words[HEAD_WORDS..];
        for output in outputs {
            let [sent, _] = next_samples(&mut rest, output);
            if output.is_due(tick) {
                output.words(node)?.copy_from_slice(sent);
            }
        }
        Ok(())
    }
}

/// The two samples of `output` at the start of `rest`: the one that is sent, and the one that follows it.
fn next_samples<'a>(rest: &mut &'a mut [u64], output: &OutPort) -> [&'a mut [u64]; 2] {
    let length = output.sample_words();
    let (both, behind) = std::mem::take(rest).split_at_mut(2 * length);
    *rest = behind;
    let (sent, next) = both.split_at_mut(length);
    [sent, next]
}

#[cfg(test)]
mod tests {
    use super::{Due, HEAD_WORDS, Timing};
    use crate::computing_time::ComputingTime;
    use crate::random::stream;

    fn timing(time: ComputingTime, period_ticks: u32) -> Timing {
        Timing { time, random: stream(1, "test"), tick_ns: 1_000_000, period_ticks }
    }

    /// At which due ticks below `end` a node without outputs steps, from `words` on, and which steps overrun.
    fn steps(timing: &mut Timing, words: &mut [u64], due: std::ops::Range<u32>) -> (Vec<u32>, Vec<u32>) {
        let (mut stepped, mut overran) = (Vec::new(), Vec::new());
        for tick in due.step_by(timing.period_ticks as usize) {
            if timing.begin(tick, words, &[]) == Due::Step {
                stepped.push(tick);
                if timing.end(tick, words, &mut [], "test").unwrap() {
                    overran.push(tick);
                }
            }
        }
        (stepped, overran)
    }

    #[test]
    fn a_step_of_as_many_ticks_as_the_period_is_done_in_time_and_one_more_skips_one() {
        for (ms, period_ticks, stepped, overran) in [
            (0.0, 1, vec![0, 1, 2, 3, 4], vec![]),
            (1.0, 1, vec![0, 1, 2, 3, 4], vec![]),
            (1.5, 1, vec![0, 1, 3, 5, 7], vec![1, 3, 5, 7]),
            (4.0, 4, vec![0, 4, 8, 12, 16], vec![]),
            (4.1, 4, vec![0, 4, 12, 20, 28], vec![4, 12, 20, 28]),
            (13.0, 4, vec![0, 4, 20, 36, 52], vec![4, 20, 36, 52]),
        ] {
            let mut timing = timing(ComputingTime::Constant { us: ms * 1e3 }, period_ticks);
            let (found, late) = steps(&mut timing, &mut [0; HEAD_WORDS], 0..stepped[4] + 1);
            assert_eq!((found, late), (stepped, overran), "{ms} ms every {period_ticks} ticks");
        }
    }

    #[test]
    fn who_has_the_words_goes_on_as_their_owner_would() {
        let time = || ComputingTime::Uniform { min_us: 100.0, max_us: 9000.0 };
        for period_ticks in [1, 3] {
            let mut alone = [0; HEAD_WORDS];
            let (whole, late) = steps(&mut timing(time(), period_ticks), &mut alone, 0..3000);
            assert!(late.len() > 200, "{}", late.len());
            for end in [3, 300, 1500] {
                let mut words = [0; HEAD_WORDS];
                let (mut stepped, _) = steps(&mut timing(time(), period_ticks), &mut words, 0..end);
                stepped.extend(steps(&mut timing(time(), period_ticks), &mut words, end..3000).0);
                assert_eq!((&stepped, words), (&whole, alone), "from tick {end} on");
            }
        }
    }
}
