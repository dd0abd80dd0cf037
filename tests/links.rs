//! Data links and computing times in whole runs, on threads of this process: what comes late, what comes not at all, and
//! that both are functions of the manifest.

use hummingbus::{COMPONENTS, Host, Launcher, Manifest};
use recorder::reader::Recording;
use std::collections::BTreeMap;
use std::path::Path;

/// Messages by topic: tick, and bytes.
type Topics = BTreeMap<String, Vec<(u32, Vec<u8>)>>;

/// The hover of the data link, 1.5 s of it, with what `more` says.
fn load(base: &str, more: &str) -> Result<Manifest, hummingbus::Diagnostic> {
    let folder = tempfile::tempdir().unwrap();
    let base = format!("{}/manifests/{base}", env!("CARGO_MANIFEST_DIR"));
    let path = folder.path().join("test.toml");
    std::fs::write(&path, format!("include = [{base:?}]\n[run]\nduration_s = 1.5\n{more}")).unwrap();
    Manifest::load(&path, &[], COMPONENTS)
}

/// The messages of a flight of [`load`], without those of shadows, and what there is to say of computing times.
fn fly(base: &str, more: &str) -> (Topics, Vec<(String, u32, u32)>) {
    let folder = tempfile::tempdir().unwrap();
    let manifest = load(base, more).unwrap();
    let launcher = Launcher::new(Host::Threads);
    let (outcome, _) = launcher.fly(&manifest, &folder.path().join("test.mcap")).unwrap();
    (topics(&folder.path().join("test.mcap")), outcome.overruns)
}

fn topics(path: &Path) -> Topics {
    let mut topics = Topics::new();
    for record in Recording::open(path).unwrap().messages().map(Result::unwrap) {
        if !record.topic.starts_with("/shadow/") {
            topics.entry(record.topic).or_default().push((record.tick, record.cdr));
        }
    }
    topics
}

/// The stamp in a message whose first field it is, in milliseconds.
fn stamp_ms(cdr: &[u8]) -> u32 {
    let word = |at: usize| u32::from_le_bytes(cdr[at..at + 4].try_into().unwrap());
    word(4) * 1000 + word(8) / 1_000_000
}

/// Requires that two flights sent the same.
#[track_caller]
fn require_same(a: &Topics, b: &Topics) {
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    for (topic, messages) in a {
        assert_eq!(messages.len(), b[topic].len(), "messages on {topic}");
        let differing = messages.iter().zip(&b[topic]).find(|(a, b)| a != b);
        assert!(differing.is_none(), "{topic} differs at tick {:?}", differing.map(|(a, _)| a.0));
    }
}

/// A swap at 0.8 s by an identical process.
fn swap(process: &str) -> String {
    format!("[[swap]]\nprocess = \"{process}\"\nat_tick = 800\nshadow_ticks = 50\n")
}

#[test]
fn a_message_comes_out_as_it_was_sent_when_its_bits_have_passed() {
    let (topics, _) = fly("ground-station.toml", "");
    let sent = &topics["/pilot/set_point"];
    for (tick, cdr) in &topics["/up/set_point"] {
        // Taken every 20 ms, and 350 bits are out 6.08 ms later: at the seventh tick.
        let taken = tick.checked_sub(7).map(|arrived| arrived / 20 * 20);
        match taken {
            // 1.0 m, as the manifest says, and the stamp of none.
            None => {
                let stamp_s = i32::from_le_bytes(cdr[4..8].try_into().unwrap());
                assert_eq!((stamp_s, &cdr[12..20]), (-1, &1.0_f64.to_le_bytes()[..]), "tick {tick}");
            }
            Some(taken) => assert_eq!(cdr, &sent[taken as usize].1, "tick {tick}"),
        }
    }
}

#[test]
fn a_link_repeats_itself_and_a_swap_in_flight_loses_nothing_that_is_under_way() {
    let bad = "[process.up]\nparameters = { latency_ms = 60.0, jitter_ms = 30.0, loss = 0.3 }\n\
               [process.down]\nparameters = { latency_ms = 60.0, jitter_ms = 30.0, loss = 0.3 }\n";
    let (alone, _) = fly("ground-station.toml", bad);
    let (again, _) = fly("ground-station.toml", &format!("window_ticks = 7\n{bad}"));
    require_same(&alone, &again);
    let (swapped, _) = fly("ground-station.toml", &format!("{bad}{}", swap("down")));
    require_same(&alone, &swapped);
    // Else nothing was tried: telemetry was lost, and some was under way at the swap.
    let statistics = &alone["/down/statistics"];
    let word =
        |tick: usize, at: usize| u32::from_le_bytes(statistics[tick].1[4 + at..8 + at].try_into().unwrap());
    let [under_way, lost] = [word(800, 32), word(1499, 40)];
    assert!(under_way >= 2 && lost > 20, "{under_way} {lost}");
}

/// Telemetry carries back what the link up has brought: its first message, too, and its initial value not.
#[test]
fn a_link_behind_a_link_takes_each_message_once() {
    let (topics, _) = fly(
        "ground-station.toml",
        "[process.down.parameters]\nbaud = 115200.0\nstreams.set_point.rate_hz = 1000.0\n",
    );
    let (up, back) = (&topics["/up/set_point"], &topics["/down/set_point"]);
    let mut seen: Vec<&[u8]> = back.iter().map(|(_, cdr)| cdr.as_slice()).collect();
    let mut sent: Vec<&[u8]> = up.iter().map(|(_, cdr)| cdr.as_slice()).collect();
    seen.dedup();
    sent.dedup();
    assert!(seen.len() > 60 && seen.len() <= sent.len(), "{} of {}", seen.len(), sent.len());
    // The initial value of the link down, then the messages as the link up brought them, the first included.
    assert_eq!(seen[1..], sent[1..seen.len()]);
}

#[test]
fn what_a_link_cannot_carry_is_told_by_the_check() {
    let refused = |more: &str, parts: &[&str]| {
        let told = load("ground-station.toml", more)
            .and_then(|manifest| hummingbus::Graph::build(&manifest).map(drop));
        let told = told.unwrap_err().to_string();
        parts.iter().for_each(|part| assert!(told.contains(part), "{part:?} is not in {told}"));
    };
    let input = |of: &str| format!("[process.up]\ninputs.set_point = {of}\n");
    refused(
        &input("{ topic = \"/mocap/mocap\", delay_ticks = 1, initial = {} }"),
        &[
            "`set_point` of `controller` reads hummingbus_msgs/msg/SetPoint, /up/set_point carries hummingbus_msgs/msg/Mocap",
        ],
    );
    refused(&input("{ topic = \"/pilot/set_point\", delay_ticks = 0 }"), &["is forwarded and has no delay"]);
    let circle = "[process.up]\ninputs.other = { topic = \"/up/other\", delay_ticks = 1, initial = {} }\n";
    refused(circle, &["/up/other is forwarded in a circle"]);
    let unknown = "[process.up]\ninputs.other = { topic = \"/plant/stat\", delay_ticks = 1, initial = {} }\n";
    refused(unknown, &["nobody publishes /plant/stat"]);
    let text = "[process.up]\ninputs.pose = { topic = \"/plant/pose\", delay_ticks = 1, initial = {} }\n";
    refused(text, &["forwards geometry_msgs/msg/PoseStamped, which has text"]);
    let stated = "[process.up]\noutputs.set_point = { type = \"hummingbus_msgs/msg/Imu\" }\n";
    refused(
        stated,
        &["stated as hummingbus_msgs/msg/Imu, its input `set_point` carries hummingbus_msgs/msg/SetPoint"],
    );
    refused("[process.up]\nparameters.streams.setpoint = {}\n", &["streams.setpoint", "set_point"]);
    refused("[process.up]\nperiod_ticks = 2\n", &["every 2 ticks", "would miss messages"]);
    refused(
        "[process.down]\nparameters.latency_ms = 40000.0\n",
        &["are 40000 ms together, expected at most 22755 ms: 180 messages are sent each second"],
    );
    let long = "[process.down]\nparameters.queue_bytes = 50\n";
    refused(long, &["a message of `estimate` takes 55 bytes", "never be sent"]);
}

/// The queue is as long as the latency needs.
#[test]
fn more_messages_than_a_short_line_has_places_for_are_under_way() {
    let (topics, _) = fly("ground-station.toml", "[process.down]\nparameters.latency_ms = 400.0\n");
    let (_, last) = topics["/down/statistics"].last().unwrap();
    let under_way = u32::from_le_bytes(last[36..40].try_into().unwrap());
    assert!((70..80).contains(&under_way), "{under_way} of 180 a second are under way for 0.4 s");
}

#[test]
fn streams_that_offer_more_than_the_line_carries_are_told_and_dropped() {
    let slow = "[process.down]\nparameters.baud = 19200\n";
    let manifest = load("ground-station.toml", slow).unwrap();
    let warnings = hummingbus::Graph::build(&manifest).unwrap().warnings;
    let told: Vec<String> = warnings.iter().map(ToString::to_string).collect();
    let expected = "its streams offer 5580 bytes/s, overhead included, and 19200 baud carry 1920";
    assert!(told.iter().any(|told| told.contains(expected)), "{told:?}");
    let (topics, _) = fly("ground-station.toml", slow);
    let (_, last) = topics["/down/statistics"].last().unwrap();
    let sent = u64::from_le_bytes(last[12..20].try_into().unwrap());
    // From the first message, queued at time 0, to 1.499 s: 2878.08 bytes.
    assert_eq!(sent, 2878);
}

/// 160 messages of 27 bytes each second, some of them only 5 ms apart, and 4770 bytes of the other streams.
#[test]
fn a_stream_whose_messages_come_at_uneven_ticks_counts_with_its_mean_rate() {
    let more = "[process.mocap]\nparameters.rate_hz = 160.0\n\
                [process.down]\nparameters.streams.mocap.rate_hz = 1000.0\n";
    let warnings = hummingbus::Graph::build(&load("ground-station.toml", more).unwrap()).unwrap().warnings;
    let told: Vec<String> = warnings.iter().map(ToString::to_string).collect();
    let expected = "its streams offer 9090 bytes/s, overhead included, and 57600 baud carry 5760";
    assert!(told.iter().any(|told| told.contains(expected)), "{told:?}");
}

const CONTROLLER: &str = "[process.controller]\ncomputing_time";

#[test]
fn a_step_that_takes_five_ticks_is_sent_five_ticks_later_and_four_are_skipped() {
    let (instant, none) = fly("hover.toml", "");
    assert!(none.is_empty());
    let (slow, overruns) =
        fly("hover.toml", &format!("{CONTROLLER} = {{ distribution = \"constant\", ms = 5.0 }}\n"));
    // The first step is done at once; from then on one in five is computed.
    assert_eq!(overruns, [("controller".to_owned(), 300, 1199)]);
    let command = |topics: &Topics, tick: usize| topics["/controller/command"][tick].1[12..].to_vec();
    assert_eq!(command(&slow, 0), command(&instant, 0));
    // Until tick 6 the plants have had the same commands: those of tick 0.
    (1..6).for_each(|tick| assert_eq!(command(&slow, tick), command(&instant, 0), "tick {tick}"));
    for tick in (6..1500).step_by(5) {
        let end = (tick + 5).min(1500);
        (tick..end)
            .for_each(|same| assert_eq!(command(&slow, same), command(&slow, tick), "ticks {tick}, {same}"));
        if tick >= 11 {
            assert_ne!(command(&slow, tick), command(&slow, tick - 1), "tick {tick}");
        }
    }
    // What is sent at a tick has its stamp, as everything that a node computes.
    for (tick, cdr) in &slow["/controller/command"] {
        assert_eq!(stamp_ms(cdr), *tick);
    }
}

#[test]
fn computing_times_repeat_and_go_on_in_another_process() {
    let drawn = format!("{CONTROLLER} = {{ distribution = \"lognormal\", median_ms = 2.0, sigma = 1.0 }}\n");
    let (alone, overruns) = fly("hover.toml", &drawn);
    let [(_, overran, skipped)] = overruns[..] else { panic!("{overruns:?}") };
    assert!(overran > 200 && skipped > 800, "{overruns:?}");
    let (again, counted) = fly("hover.toml", &format!("window_ticks = 7\n{drawn}"));
    require_same(&alone, &again);
    assert_eq!(counted, overruns);
    let (swapped, counted) = fly("hover.toml", &format!("{drawn}{}", swap("controller")));
    require_same(&alone, &swapped);
    assert_eq!(counted, overruns);
    let (other, _) = fly("hover.toml", &format!("seed = 2\n{drawn}"));
    assert_ne!(alone["/controller/command"], other["/controller/command"]);
}

#[test]
fn a_process_that_takes_no_time_sends_what_it_would_without_the_key() {
    let (instant, _) = fly("hover.toml", "");
    let none = format!("{CONTROLLER} = {{ distribution = \"constant\", ms = 0.0 }}\n");
    let (timed, overruns) = fly("hover.toml", &none);
    require_same(&instant, &timed);
    assert_eq!(overruns, [("controller".to_owned(), 0, 0)]);
    // Such a process and one without the key take over from each other.
    let to_none =
        format!("{none}{}[swap.with.computing_time]\ndistribution = \"constant\"\nms = 0.0\n", swap("imu"));
    require_same(&instant, &fly("hover.toml", &to_none).0);
}

/// A controller that takes 5 ms from the swap on, or up to it.
#[test]
fn what_takes_time_and_what_takes_none_take_over_from_each_other() {
    let swap = swap("controller");
    let constant = |ms: f64| format!("{{ distribution = \"constant\", ms = {ms:.1} }}\n");
    let (instant, _) = fly("hover.toml", "");
    let command = |topics: &Topics, tick: usize| topics["/controller/command"][tick].1[12..].to_vec();

    let (slowed, counted) =
        fly("hover.toml", &format!("{swap}with = {{ computing_time = {} }}\n", constant(5.0).trim()));
    (0..800).for_each(|tick| assert_eq!(command(&slowed, tick), command(&instant, tick), "tick {tick}"));
    let changes = |topics: &Topics, ticks: std::ops::Range<usize>| {
        ticks.filter(|&tick| command(topics, tick) != command(topics, tick - 1)).count()
    };
    // 699 ticks, at one in five of which a step is done.
    assert!((138..=140).contains(&changes(&slowed, 801..1500)), "{}", changes(&slowed, 801..1500));
    // What it overran and skipped as the shadow of the other is not counted.
    let [(_, overran, skipped)] = &counted[..] else { panic!("{counted:?}") };
    assert!((139..=141).contains(overran) && (558..=561).contains(skipped), "{counted:?}");

    let slow = format!("{CONTROLLER} = {}", constant(5.0));
    let (hurried, _) =
        fly("hover.toml", &format!("{slow}{swap}with = {{ computing_time = {} }}\n", constant(0.0).trim()));
    assert!((158..=160).contains(&changes(&hurried, 1..800)), "{}", changes(&hurried, 1..800));
    assert!(changes(&hurried, 810..1500) > 680, "{}", changes(&hurried, 810..1500));
}

#[test]
fn an_invalid_computing_time_is_refused() {
    let refused = |of: &str, parts: &[&str]| {
        let told = load("hover.toml", &format!("{CONTROLLER} = {of}\n"));
        let told = told.and_then(|manifest| hummingbus::Graph::build(&manifest).map(drop));
        let told = told.unwrap_err().to_string();
        parts.iter().for_each(|part| assert!(told.contains(part), "{part:?} is not in {told}"));
    };
    refused(
        "{ distribution = \"constant\", ms = -1.0 }",
        &["`computing_time` of `controller`", "`ms` must be from 0", "found -1"],
    );
    refused(
        "{ distribution = \"uniform\", min_ms = 2.0, max_ms = 1.0 }",
        &["`max_ms` must be at least `min_ms`, 2", "found 1"],
    );
    refused(
        "{ distribution = \"lognormal\", median_ms = 1.0, sigma = 9.0 }",
        &["`sigma` must be at most 3", "found 9"],
    );
    refused("{ distribution = \"measured\", file = \"nowhere.json\" }", &["nowhere.json", "No such file"]);
    refused("{ distribution = \"gamma\" }", &["gamma"]);
    refused("{ ms = 1.0 }", &["distribution"]);
}
