//! Samples that a reader misses because it computes less often than they come. Measurements that a sensor does not send, or that
//! come later than the reader remembers.

use super::parameters::Notes;
use super::processes::DeclaredNode;
use bus::context::SampleTimes;
use bus::plan::{InputPlan, NodePlan, OutputPlan, Plan};
use bus::ports::Inputs;
use diagnostics::Diagnostic;
use std::ops::Range;

/// Rate from which on a reader may skip readings of a sensor at even intervals: no vehicle moves that fast. An autopilot's gyroscope
/// at 8 kHz feeds a loop at 4 kHz. Own choice.
const FAST_HZ: f64 = 1000.0;
/// Share of a period that two periods may differ by and still be equal: rates such as 30 Hz have no exact period.
const EQUAL_SHARE: f64 = 1e-6;
/// Field of the messages that state when they were measured.
const MEASURED: &str = "measured_ns";

/// Warns of samples that are never read, and of measurements that are never sent or are refused because they come too late.
pub fn check(declared_nodes: &[DeclaredNode<'_>], plan: &Plan, notes: &mut Notes) {
    let wiring = Wires { declared_nodes, plan, notes };
    let mut warnings = Vec::new();
    for (node, declared) in declared_nodes.iter().enumerate() {
        warnings.extend(plan.nodes[node].outputs.iter().filter_map(|output| wiring.unsent(node, output)));
        // A recorder takes every sample, whatever its period, and a link of 1 tick misses none.
        let is_component = declared.program.component();
        if is_component.is_some_and(|kind| matches!(kind.inputs, Inputs::Any | Inputs::Forwarded { .. })) {
            continue;
        }
        for input in &plan.nodes[node].inputs {
            warnings.extend(wiring.missed(node, input));
            warnings.extend(wiring.late(node, input));
        }
    }
    notes.warnings.extend(warnings);
}

/// The nodes of a run and their wires.
struct Wires<'a, 'm> {
    declared_nodes: &'a [DeclaredNode<'m>],
    plan: &'a Plan,
    notes: &'a Notes,
}

impl Wires<'_, '_> {
    /// Warning of the samples that `node` never reads on `input`.
    fn missed(&self, node: usize, input: &InputPlan) -> Option<Diagnostic> {
        let (reader, topic) = (&self.plan.nodes[node], &self.plan.topics[input.topic]);
        let sender = &self.plan.nodes[self.sender(input)?];
        if f64::from(reader.period_ticks) <= topic.ticks.mean() {
            return None;
        }
        let tick_s = self.plan.tick_s();
        let [sent_s, read_s] =
            [topic.ticks.mean(), f64::from(reader.period_ticks)].map(|ticks| ticks * tick_s);
        let measured_s = self.times(sender).measured_every_s.map(|measured_s| measured_s.max(sent_s));
        let period_ticks = topic.ticks.period();
        let is_even = period_ticks.is_some_and(|period| reader.period_ticks.is_multiple_of(period));
        let is_missed = match measured_s {
            Some(measured_s) => {
                read_s > measured_s * (1.0 + EQUAL_SHARE)
                    && !(is_even && read_s * FAST_HZ <= 1.0 + EQUAL_SHARE)
            }
            // The newest sample of a signal is all that a reader needs, if it is always equally old.
            None => !is_even,
        };
        if !is_missed {
            return None;
        }
        let name = &reader.name;
        let made_s = measured_s.unwrap_or(sent_s);
        let share = 100.0 * (1.0 - made_s / read_s);
        let what = if measured_s.is_some() { "measurements" } else { "samples" };
        let age = if is_even { "" } else { ", and the others are not equally old when they are read" };
        let message = format!(
            "input `{}` of `{name}`: {} has {} new {what} a second, `{name}` computes {} times a second (period_ticks = {}): \
             {share:.0} % of the {what} are never read{age}",
            input.port,
            topic.name,
            rate(made_s),
            rate(read_s),
            reader.period_ticks,
        );
        let help = format!(
            "lower `period_ticks` of `{name}` to {}, or let `{}` {} less often",
            lower_period(made_s, tick_s, period_ticks.unwrap_or(1)),
            sender.name,
            if measured_s.is_some() { "measure" } else { "send" },
        );
        Some(self.at(node, input, message, help))
    }

    /// Warning of measurements that `node` never sends, since the manifest states a longer `every_ticks` of `output`. A sensor that
    /// measures whenever it computes may send less often on purpose.
    fn unsent(&self, node: usize, output: &OutputPlan) -> Option<Diagnostic> {
        let (sender, topic) = (&self.plan.nodes[node], &self.plan.topics[output.topic]);
        let measured_s = self.times(sender).measured_every_s?;
        let [computed_s, sent_s] =
            [f64::from(sender.period_ticks), topic.ticks.mean()].map(|ticks| ticks * self.plan.tick_s());
        let has_own_rate = measured_s > computed_s * (1.0 + EQUAL_SHARE);
        if !has_own_rate || sent_s <= measured_s * (1.0 + EQUAL_SHARE) {
            return None;
        }
        let (name, port) = (&sender.name, &output.port);
        let declared = &self.declared_nodes[node];
        let stated = declared.process.outputs.keys().find(|stated| stated.get_ref() == port)?;
        let message = format!(
            "output `{port}` of `{name}`: `{name}` measures {} times a second, {} is sent {} times a second: {:.0} % of the \
             measurements are never sent",
            rate(measured_s),
            topic.name,
            rate(sent_s),
            100.0 * (1.0 - measured_s / sent_s),
        );
        let help = format!("leave `every_ticks` out, and lower the rate of `{name}` if fewer are enough");
        Some(declared.manifest.problem(&stated.span(), message, help))
    }

    /// Warning of measurements on `input` that come later than `node` remembers.
    fn late(&self, node: usize, input: &InputPlan) -> Option<Diagnostic> {
        let reader = &self.plan.nodes[node];
        let remembered_s = self.times(reader).remembered_s?;
        let type_name = &self.plan.topics[input.topic].type_name;
        let schema = self.declared_nodes[node].manifest.registry().message(type_name)?;
        if !schema.fields.iter().any(|field| field.name == MEASURED) {
            return None;
        }
        let delay_s = self.delay_s(input, self.plan.nodes.len());
        if delay_s <= remembered_s * (1.0 + EQUAL_SHARE) {
            return None;
        }
        let [delay_ms, remembered_ms] = [delay_s, remembered_s].map(|s| (s * 1e6).round() / 1e3);
        let (name, port) = (&reader.name, &input.port);
        let message = format!(
            "input `{port}` of `{name}`: its measurements are at least {delay_ms} ms old when they arrive, and `{name}` remembers \
             {remembered_ms} ms (`delay_max_ms`): it refuses all of them"
        );
        let help =
            format!("raise `delay_max_ms` of `{name}` above {delay_ms}, or lower the delay on the way");
        Some(self.at(node, input, message, help))
    }

    /// Least age of a measurement on `input`, with the delays of the sensor and of the links between.
    fn delay_s(&self, input: &InputPlan, nodes_left: usize) -> f64 {
        let Some(sender) = self.sender(input) else { return 0.0 };
        let own_s =
            self.times(&self.plan.nodes[sender]).delay_s + f64::from(input.delay_ticks) * self.plan.tick_s();
        let kind = self.declared_nodes[sender].program.component();
        let is_forwarded = kind.is_some_and(|kind| matches!(kind.inputs, Inputs::Forwarded { .. }));
        let output = self.plan.nodes[sender].outputs.iter().find(|output| output.topic == input.topic);
        let forwarded = self.plan.nodes[sender]
            .inputs
            .iter()
            .find(|before| is_forwarded && output.is_some_and(|output| output.port == before.port));
        match forwarded {
            Some(before) if nodes_left > 0 => own_s + self.delay_s(before, nodes_left - 1),
            _ => own_s,
        }
    }

    /// The node that sends what `input` reads.
    fn sender(&self, input: &InputPlan) -> Option<usize> {
        let is_sender = |node: &NodePlan| node.outputs.iter().any(|output| output.topic == input.topic);
        self.plan.nodes.iter().position(is_sender)
    }

    fn times(&self, node: &NodePlan) -> SampleTimes {
        self.notes.times.get(&node.name).copied().unwrap_or_default()
    }

    fn at(&self, node: usize, input: &InputPlan, message: String, help: String) -> Diagnostic {
        let declared = &self.declared_nodes[node];
        let port = declared.process.inputs.keys().find(|port| *port.get_ref() == input.port);
        let span: Range<usize> = port.map_or_else(|| declared.name.span(), toml::Spanned::span);
        declared.manifest.problem(&span, message, help)
    }
}

/// Rate of a period, with three digits behind the point at most.
fn rate(period_s: f64) -> f64 {
    (1e3 / period_s).round() / 1e3
}

/// Longest period, in ticks, at which no measurement that is made every `made_s` and sent every `sent_ticks` is missed.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "less than the reader's period")]
fn lower_period(made_s: f64, tick_s: f64, sent_ticks: u32) -> u32 {
    let ticks = (made_s / tick_s * (1.0 + EQUAL_SHARE)).floor() as u32;
    (ticks / sent_ticks * sent_ticks).max(1)
}
