//! One condition or measure, evaluated as samples pass.

use super::figures::Found;
use super::signals::{Signal, Signals};
use super::statistic::Samples;
use super::verdict::within;
use crate::response::{NoResponse, Response};
use anyhow::{Result, anyhow, bail};
use recorder::RecordingError;
use recorder::fields::TopicFields;
use runtime::manifest::{PassCondition, Reference, Statistic};
use serde::{Deserialize, Serialize};

/// A condition or measure and everything that it keeps of the samples so far.
#[derive(Debug)]
pub struct Condition {
    pass: PassCondition,
    judged: Signal,
    minus: Option<Signal>,
    reference: Option<Signal>,
    gate: Option<Signal>,
    /// Factor from the unit of the statistic to that of the limits; known from the first sample on.
    factor: Option<f64>,
    samples: Samples,
    pairs: Pairs,
    /// Time of the first sample after which the condition cannot hold any more.
    lost_ns: Option<u64>,
    /// Time of the newest sample that counts.
    last_ns: Option<u64>,
}

/// Samples of a field and of its reference within the span, of which the lag and the gain are computed at the end.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Pairs {
    field: Vec<f64>,
    reference: Vec<f64>,
    /// Times of the first two samples of the field, in ns.
    first_ns: Option<u64>,
    second_ns: Option<u64>,
}

/// Contents of a condition in a checkpoint.
#[derive(Serialize, Deserialize)]
pub struct KeptSamples {
    /// Name of the condition.
    pub name: String,
    factor: Option<f64>,
    samples: Samples,
    pairs: Pairs,
    /// Time of the first sample after which the condition cannot hold any more.
    pub lost_ns: Option<u64>,
    last_ns: Option<u64>,
}

impl Condition {
    /// The condition `pass`, of whose topics no sample has come yet.
    ///
    /// # Errors
    /// As `open` says.
    pub fn new(
        pass: &PassCondition,
        signals: &mut Signals,
        open: &mut dyn FnMut(&str) -> Result<TopicFields, RecordingError>,
    ) -> Result<Self> {
        let mut signal = |topic: &str, field: &str| signals.signal(topic, field, open);
        let judged = signal(&pass.topic, &pass.field)?;
        let minus = pass.minus.as_ref().map(|minus| signal(&minus.topic, &minus.field)).transpose()?;
        let reference =
            pass.reference.as_ref().map(|other| signal(&other.topic, &other.field)).transpose()?;
        let gate = pass.gate.as_ref().map(|gate| signal(&gate.topic, &gate.field)).transpose()?;
        Ok(Self {
            pass: pass.clone(),
            judged,
            minus,
            reference,
            gate,
            factor: None,
            samples: Samples::default(),
            pairs: Pairs::default(),
            lost_ns: None,
            last_ns: None,
        })
    }

    /// Reserves memory for a run of `duration_ns` in ticks of `tick_ns`, so that no sample allocates.
    pub fn reserve(&mut self, duration_ns: u64, tick_ns: u64) {
        if self.reference.is_some() {
            let end_s = duration_ns as f64 * 1e-9;
            let span_s = self.pass.to_s.unwrap_or(end_s).min(end_s) - self.pass.from_s;
            // One more at either end of the span.
            let most = count(span_s / (tick_ns as f64 * 1e-9)) + 2;
            self.pairs.field.reserve_exact(most);
            self.pairs.reference.reserve_exact(most);
        }
    }

    /// The samples and figures kept so far.
    pub fn kept(&self) -> KeptSamples {
        let Self { pass, factor, samples, pairs, lost_ns, last_ns, .. } = self;
        let (name, pairs) = (pass.name.clone(), pairs.clone());
        let (factor, samples) = (*factor, *samples);
        KeptSamples { name, factor, samples, pairs, lost_ns: *lost_ns, last_ns: *last_ns }
    }

    /// Goes on from the samples that another evaluation of the condition has `kept`.
    ///
    /// # Errors
    /// If it is of another condition.
    pub fn go_on(&mut self, kept: KeptSamples) -> Result<()> {
        let name = &self.pass.name;
        if kept.name != *name {
            bail!("it holds the samples of `{}` where the manifest has `{name}`", kept.name);
        }
        // In the memory that was reserved.
        self.pairs.field.extend(kept.pairs.field);
        self.pairs.reference.extend(kept.pairs.reference);
        (self.pairs.first_ns, self.pairs.second_ns) = (kept.pairs.first_ns, kept.pairs.second_ns);
        (self.factor, self.samples) = (kept.factor, kept.samples);
        (self.lost_ns, self.last_ns) = (kept.lost_ns, kept.last_ns);
        Ok(())
    }

    /// Ends the tick at `time_ns`, all of whose samples `signals` has.
    ///
    /// # Errors
    /// If the fields or units of the condition do not fit each other.
    pub fn end_tick(&mut self, signals: &Signals, time_ns: u64) -> Result<()> {
        let Some(judged) = signals.fresh(self.judged) else { return Ok(()) };
        let factor = match self.factor {
            Some(factor) => factor,
            None => *self.factor.insert(self.factor(signals.unit(self.judged))?),
        };
        self.require_shapes(signals, judged)?;
        self.pairs.note(time_ns);
        if !self.is_in_span(time_ns) {
            return Ok(());
        }
        if let Some(reference) = self.reference {
            if let Some(reference) = signals.held(reference) {
                self.last_ns = Some(time_ns);
                self.pairs.field.push(judged[0]);
                self.pairs.reference.push(reference[0]);
            }
        } else if self.is_open(signals)
            && let Some(value) = difference(judged, self.minus.map(|minus| signals.held(minus)))
        {
            let value = value * factor;
            self.samples.add(value);
            self.last_ns = Some(time_ns);
            if self.lost_ns.is_none() && self.is_lost_by(value) {
                self.lost_ns = Some(time_ns);
            }
        }
        Ok(())
    }

    /// The values of the condition.
    pub fn finish(&self) -> Found {
        let [lost_s, last_s] = [self.lost_ns, self.last_ns].map(|ns| Some(ns? as f64 * 1e-9));
        let found = Found { lost_s, last_s, ..Found::default() };
        let Some(reference) = &self.pass.reference else {
            return Found { values: self.samples.values(self.pass.statistic), ..found };
        };
        match self.pairs.response(reference) {
            Ok((response, step_s)) => {
                let value = match self.pass.statistic {
                    Statistic::Lag => response.lag_samples as f64 * step_s,
                    _ => response.gain,
                };
                Found { values: vec![value * self.factor.unwrap_or(1.0)], ..found }
            }
            Err(why) => Found { why: Some(why.to_string()), ..found },
        }
    }

    /// Factor from the unit of the statistic of a field in `field_unit` to that of the limits.
    fn factor(&self, field_unit: &str) -> Result<f64> {
        let PassCondition { name, statistic, unit, .. } = &self.pass;
        diagnostics::convert(statistic.unit(field_unit), unit).map_err(|error| anyhow!("`{name}`: {error}"))
    }

    /// Refuses vectors beside numbers, and a reference in another unit, as soon as there are samples of both.
    fn require_shapes(&self, signals: &Signals, judged: &[f64]) -> Result<()> {
        let name = &self.pass.name;
        let length = |signal: Option<Signal>| signals.held(signal?).map(<[f64]>::len);
        if length(self.minus).is_some_and(|other| other != judged.len()) {
            bail!("`{name}`: `minus` takes a vector off a number, or a number off a vector");
        }
        if length(self.gate).is_some_and(|gate| gate != 1) {
            bail!("`{name}`: `while` is of one number, not of a vector");
        }
        let Some((signal, other)) = self.reference.zip(length(self.reference)) else { return Ok(()) };
        if judged.len() + other != 2 {
            bail!("`{name}`: a lag or a gain is of one number behind another, not of vectors");
        }
        let (unit, other) = (signals.unit(self.judged), signals.unit(signal));
        if unit != other {
            let reference = self.pass.reference.as_ref();
            let (topic, path) =
                reference.map_or(("", ""), |reference| (&*reference.topic, &*reference.field));
            bail!("`{name}`: the field is in `{unit}`, its reference, `{path}` of {topic}, in `{other}`");
        }
        Ok(())
    }

    fn is_in_span(&self, time_ns: u64) -> bool {
        // Half a nanosecond of slack: limits in seconds are not exact in binary.
        let time_s = time_ns as f64 * 1e-9;
        let PassCondition { from_s, to_s, .. } = self.pass;
        time_s >= from_s - 5e-10 && to_s.is_none_or(|to_s| time_s <= to_s + 5e-10)
    }

    /// True if the condition fails by this sample, for any samples behind it.
    fn is_lost_by(&self, value: f64) -> bool {
        let PassCondition { min, max, .. } = self.pass;
        match self.pass.statistic {
            Statistic::Every => !within(value, min, max),
            Statistic::Max => !within(value, None, max),
            Statistic::Min => !within(value, min, None),
            _ => false,
        }
    }

    /// True if the newest value of the gate is within its limits.
    fn is_open(&self, signals: &Signals) -> bool {
        self.pass.gate.as_ref().zip(self.gate).is_none_or(|(gate, signal)| {
            signals.held(signal).is_some_and(|value| within(value[0], gate.min, gate.max))
        })
    }
}

impl Pairs {
    fn note(&mut self, time_ns: u64) {
        if self.first_ns.is_none() {
            self.first_ns = Some(time_ns);
        } else if self.second_ns.is_none() {
            self.second_ns = Some(time_ns);
        }
    }

    /// Response of the field to `reference`, and the time between two samples in seconds.
    fn response(&self, reference: &Reference) -> Result<(Response, f64), NoResponse> {
        let (first, second) = self.first_ns.zip(self.second_ns).ok_or(NoResponse::TooShort)?;
        let step_s = (second - first) as f64 * 1e-9;
        let reach = count(reference.within_s / step_s);
        Response::of(&self.field, &self.reference, reach).map(|response| (response, step_s))
    }
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a number of samples, cut off where absurd"
)]
fn count(count: f64) -> usize {
    count.round() as usize
}

/// The judged value of a sample: a number less the one that is subtracted, or the length of such a vector; `None`
/// before the first sample of the subtracted signal.
fn difference(judged: &[f64], taken: Option<Option<&[f64]>>) -> Option<f64> {
    let off = |part: usize| match taken {
        None => Some(0.0),
        Some(taken) => taken.and_then(|values| values.get(part).copied()),
    };
    if let [value] = judged {
        return Some(value - off(0)?);
    }
    let squares = judged.iter().enumerate().map(|(part, value)| {
        let difference = value - off(part)?;
        Some(difference * difference)
    });
    squares.sum::<Option<f64>>().map(f64::sqrt)
}

#[cfg(test)]
mod tests {
    use crate::judge::evaluator::Evaluator;
    use crate::judge::verdict::Verdict;
    use bus::announcement::Announcement;
    use recorder::fields::TopicFields;
    use runtime::manifest::{Conditions, PassCondition};

    /// Samples of a topic, by second: the values of its field `p`, a number or a vector, in this unit.
    struct Samples {
        topic: &'static str,
        unit: &'static str,
        first_s: u64,
        every_s: u64,
        values: Vec<Vec<f64>>,
    }

    fn samples(topic: &'static str, unit: &'static str, values: &[f64]) -> Samples {
        Samples {
            topic,
            unit,
            first_s: 0,
            every_s: 1,
            values: values.iter().map(|value| vec![*value]).collect(),
        }
    }

    impl Samples {
        fn open(&self) -> TopicFields {
            let body = if self.values[0].len() == 1 {
                format!("float64 p # [{}]\n", self.unit)
            } else {
                let rule = "=".repeat(80);
                format!("a/V p # [{}]\n{rule}\nMSG: a/V\nfloat64 x\nfloat64 y\nfloat64 z\n", self.unit)
            };
            let announcement = Announcement {
                type_name: "a/msg/P".to_owned(),
                size: 0,
                layout_hash: 0,
                layout: String::new(),
                definition: body,
                stamp_offset: None,
                extent: None,
            };
            TopicFields::announced(self.topic, &announcement).unwrap()
        }

        fn at(&self, second: u64) -> Option<Vec<u8>> {
            let since_s =
                second.checked_sub(self.first_s).filter(|since| since.is_multiple_of(self.every_s))?;
            let values = self.values.get(usize::try_from(since_s / self.every_s).ok()?)?;
            let bytes = values.iter().flat_map(|value| value.to_le_bytes());
            Some([0, 1, 0, 0].into_iter().chain(bytes).collect())
        }
    }

    /// The verdict on `pass`. Within a tick the topics come in the order given.
    fn verdict(pass: &PassCondition, topics: &[Samples]) -> anyhow::Result<Verdict> {
        let conditions = Conditions { pass: vec![pass.clone()], ..Conditions::default() };
        let open = |topic: &str| Ok(topics.iter().find(|one| one.topic == topic).unwrap().open());
        let mut evaluator = Evaluator::new(&conditions, open)?;
        for second in 0..100 {
            for samples in topics {
                if let Some(cdr) = samples.at(second) {
                    evaluator.take(evaluator.topic(samples.topic).unwrap(), &cdr)?;
                }
            }
            evaluator.end_tick(second * 1_000_000_000)?;
        }
        Ok(Verdict::of(pass, &evaluator.finish().pass[0]))
    }

    fn condition(more: &str) -> PassCondition {
        let text = format!(
            "name = \"c\"\ntopic = \"/a\"\nfield = \"p\"\nunit = \"m\"\nstatistic = \"every\"\nmin = 0.0\n{more}"
        );
        toml::from_str(&text).unwrap()
    }

    #[test]
    fn a_vector_less_another_is_judged_by_its_length() {
        let minus = condition("minus = { topic = \"/b\", field = \"p\" }");
        let vectors = |topic, values: [[f64; 3]; 2]| Samples {
            topic,
            unit: "m",
            first_s: 0,
            every_s: 1,
            values: values.map(|vector| vector.to_vec()).to_vec(),
        };
        let judged = vectors("/a", [[1.0, 0.0, 0.0], [4.0, 1.0, 0.0]]);
        let taken = vectors("/b", [[1.0, 0.0, 0.0], [1.0, -3.0, 0.0]]);
        assert_eq!(verdict(&minus, &[judged, taken]).unwrap().values, [0.0, 5.0]);
        let judged = vectors("/a", [[1.0, 0.0, 0.0], [4.0, 1.0, 0.0]]);
        let error = verdict(&minus, &[samples("/b", "m", &[1.0]), judged]).unwrap_err().to_string();
        assert!(error.contains("`c`: `minus` takes a vector off a number"), "{error}");
    }

    /// Also where the sample of the same tick comes behind the judged one in the tick, as it does in a file.
    #[test]
    fn only_samples_while_the_gate_is_open_count() {
        let gated = condition("while = { topic = \"/g\", field = \"p\", min = 1, max = 2 }");
        let judged = || samples("/a", "m", &[7.0, 8.0, 9.0, 10.0]);
        // The gate's last sample holds for the judged ones after it.
        let gate = || samples("/g", "1", &[0.0, 1.0, 2.0]);
        for topics in [[judged(), gate()], [gate(), judged()]] {
            let verdict = verdict(&gated, &topics).unwrap();
            assert_eq!(verdict.values, [8.0, 10.0]);
            assert!(verdict.passed);
        }
    }

    #[test]
    fn samples_before_the_first_of_what_is_taken_off_do_not_count() {
        let minus = condition("minus = { topic = \"/b\", field = \"p\" }");
        let mut late = samples("/b", "m", &[1.0]);
        late.first_s = 1;
        assert_eq!(verdict(&minus, &[samples("/a", "m", &[9.0, 3.0]), late]).unwrap().values, [2.0, 2.0]);
    }

    /// The condition on the lag or gain of `/a` behind `/b`, in `unit`.
    fn response(statistic: &str, unit: &str, more: &str) -> PassCondition {
        let text = format!(
            "name = \"c\"\ntopic = \"/a\"\nfield = \"p\"\nunit = \"{unit}\"\nstatistic = \"{statistic}\"\nmin = -2500.0\n\
             reference = {{ topic = \"/b\", field = \"p\", within_s = 4.0 }}\n{more}"
        );
        toml::from_str(&text).unwrap()
    }

    /// A pulse of 1 among 20 samples, around the sample `at`.
    fn pulse(at: i32) -> Vec<f64> {
        (0..20).map(|index| f64::from(3 - i32::min((index - at).abs(), 3))).collect()
    }

    #[test]
    fn lag_and_gain_are_told_in_the_unit_of_the_limits() {
        let doubled: Vec<f64> = pulse(7).iter().map(|value| value * 2.0).collect();
        for (reference_at, lag_s) in [(5, 2.0), (7, 0.0), (10, -3.0)] {
            let both = [samples("/a", "m", &doubled), samples("/b", "m", &pulse(reference_at))];
            assert_eq!(verdict(&response("lag", "s", ""), &both).unwrap().values, [lag_s]);
            let lag = verdict(&response("lag", "ms", ""), &both).unwrap();
            assert_eq!((lag.values[0], lag.passed), (lag_s * 1000.0, lag_s > -2.5));
            assert!((verdict(&response("gain", "1", ""), &both).unwrap().values[0] - 2.0).abs() < 1e-12);
        }
    }

    #[test]
    fn the_span_is_that_of_the_field_and_a_slower_reference_is_held() {
        let lag = response("lag", "s", "from_s = 1.0\nto_s = 18.0");
        let slow = pulse(6).into_iter().step_by(2).collect::<Vec<_>>();
        let mut slow = samples("/b", "m", &slow);
        slow.every_s = 2;
        assert_eq!(verdict(&lag, &[samples("/a", "m", &pulse(9)), slow]).unwrap().values, [2.0]);
    }

    #[test]
    fn a_lag_that_nothing_tells_fails_and_says_why() {
        let constant = [samples("/a", "m", &pulse(9)), samples("/b", "m", &[1.0; 20])];
        let verdict_of = |both: &[Samples]| verdict(&response("lag", "s", ""), both);
        let judged = verdict_of(&constant).unwrap();
        assert!(!judged.passed && judged.values.is_empty());
        let text = judged.to_string();
        assert!(text.contains("FAILED c: no value: the reference is constant"), "{text}");
        let other = [samples("/a", "m", &pulse(9)), samples("/b", "rad", &pulse(9))];
        let error = verdict_of(&other).unwrap_err().to_string();
        assert!(
            error.contains("`c`") && error.contains("`m`") && error.contains("`p` of /b, in `rad`"),
            "{error}"
        );
    }

    #[test]
    fn a_condition_that_no_sample_breaks_fails_at_the_last_sample_of_its_span() {
        let of = |statistic: &str, limits: &str| {
            let text = format!("from_s = 1.0\nto_s = 3.0\n{limits}");
            let text = format!(
                "name = \"c\"\ntopic = \"/a\"\nfield = \"p\"\nunit = \"m\"\nstatistic = \"{statistic}\"\n{text}"
            );
            verdict(&toml::from_str(&text).unwrap(), &[samples("/a", "m", &[9.0, 5.0, 7.0, 6.0, 0.0])])
                .unwrap()
        };
        for (statistic, limits) in [
            ("mean", "max = 1.0"),
            ("rms", "max = 1.0"),
            ("last", "max = 1.0"),
            ("span", "max = 1.0"),
            // The greatest sample is too small, the least one too great.
            ("max", "min = 8.0"),
            ("min", "max = 1.0"),
        ] {
            let failed = of(statistic, limits);
            assert_eq!((failed.failed_at_s, failed.failed_at_end), (Some(3.0), true), "{statistic}");
            assert!(failed.to_string().ends_with(", at the end of its span, 3.000 s"), "{failed}");
            assert_eq!(of(statistic, "max = 10.0").failed_at_s, None, "{statistic}");
        }
        let failed = of("max", "max = 6.5");
        assert_eq!((failed.failed_at_s, failed.failed_at_end), (Some(2.0), false));
        assert!(failed.to_string().ends_with(", first at 2.000 s"), "{failed}");
        let both = [samples("/a", "m", &pulse(7)), samples("/b", "m", &pulse(5))];
        let lag = verdict(&response("lag", "s", "max = 1.0\nto_s = 18.0"), &both).unwrap();
        assert_eq!((lag.passed, lag.failed_at_s), (false, Some(18.0)));
        // A span without a sample has no time.
        assert_eq!(
            verdict(&condition("from_s = 5.0"), &[samples("/a", "m", &[1.0])]).unwrap().failed_at_s,
            None
        );
    }

    #[test]
    fn a_gate_that_never_opens_fails_and_so_does_a_span_without_a_sample() {
        let gated = condition("while = { topic = \"/g\", field = \"p\", min = 1 }");
        assert!(!verdict(&gated, &[samples("/a", "m", &[1.0]), samples("/g", "1", &[0.0])]).unwrap().passed);
        let verdict = verdict(&condition("from_s = 5.0"), &[samples("/a", "m", &[1.0])]).unwrap();
        assert_eq!(verdict.to_string(), "  FAILED c: no samples (at least 0)");
    }
}
