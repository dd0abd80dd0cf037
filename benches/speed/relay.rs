//! A node that passes a payload on: the bus with nothing to compute.

use crate::report::Result;
use bus::host_time::monotonic_ns;
use bus::messages::Time;
use bus::{Message, Node};
use hdrhistogram::Histogram;
use serde::Deserialize;
use std::path::PathBuf;

macro_rules! payloads {
    ($($name:ident $type_name:literal $bytes:literal),*) => {
        $(
            /// A message of a given size; only its counter is written, as with any zero-copy transport.
            #[derive(Clone, Copy, Message)]
            #[repr(C)]
            #[message(type_name = $type_name)]
            struct $name {
                stamp: Time,
                counter: u64,
                rest: [u8; $bytes - 16],
            }
            impl Counted for $name {
                fn counter(&mut self) -> &mut u64 {
                    &mut self.counter
                }
            }
        )*
        /// The payload sizes in bytes, with their message types.
        pub const PAYLOADS: &[(usize, &str)] = &[$(($bytes, $type_name)),*];
        fn run(bytes: usize) -> Result<()> {
            match bytes {
                $($bytes => relay::<$name>(),)*
                _ => Err(format!("no payload of {bytes} bytes").into()),
            }
        }
    };
}
payloads!(
    Payload64 "bench_msgs/msg/Payload64" 64,
    Payload1k "bench_msgs/msg/Payload1k" 1024,
    Payload64k "bench_msgs/msg/Payload64k" 65536,
    Payload1m "bench_msgs/msg/Payload1m" 1048576,
    Payload4m "bench_msgs/msg/Payload4m" 4194304
);

trait Counted: Message {
    fn counter(&mut self) -> &mut u64;
}

#[derive(Deserialize)]
struct Parameters {
    /// File for the latencies of this hop, one line of nanoseconds.
    latency_file: Option<PathBuf>,
}

/// Longer latencies count as this.
const LATENCY_NS_MAX: u64 = 10_000_000_000;

/// Runs a relay whose payload has the size given as the only argument.
pub fn process(args: &[String]) -> Result<()> {
    let [bytes] = args else { return Err("one argument: the payload's size".into()) };
    run(bytes.parse()?)
}

fn relay<T: Counted>() -> Result<()> {
    let mut node = Node::join()?;
    let input = node.input::<T>("input")?;
    let output = node.output::<T>("output")?;
    let parameters: Parameters = node.parameters()?;
    let mut latency = Histogram::<u64>::new_with_bounds(1, LATENCY_NS_MAX, 3)?;
    node.run(|tick| {
        let [.., sent_ns] = tick.host_times_ns(input);
        if sent_ns > 0 {
            latency.saturating_record(monotonic_ns().saturating_sub(sent_ns));
        }
        let number = u64::from(tick.number());
        tick.in_place(output).map(|payload| *payload.counter() = number)
    })?;
    if let Some(path) = parameters.latency_file {
        let quantiles = [0.5, 0.99, 0.999].map(|quantile| latency.value_at_quantile(quantile).to_string());
        std::fs::write(path, quantiles.join(" "))?;
    }
    Ok(())
}

/// A manifest of a ring of relays, with their cores and waiting.
pub fn ring_manifest(
    bytes: usize,
    cores: &[Option<usize>],
    wait: &str,
    ticks: u32,
    window: u32,
    latency_file: Option<&std::path::Path>,
) -> Result<String> {
    let type_name = PAYLOADS.iter().find(|(size, _)| *size == bytes).ok_or("no such payload")?.1;
    let binary = std::env::current_exe()?;
    let mut text = format!("[run]\nduration_s = {}\nwindow_ticks = {window}\n", f64::from(ticks) * 1e-3);
    for (index, core) in cores.iter().enumerate() {
        let before = (index + cores.len() - 1) % cores.len();
        let delay = if index == 0 { ", delay_ticks = 1, initial = {}" } else { "" };
        let cpu = core.map_or(String::new(), |core| format!("cpu = {core}\n"));
        let parameters = match latency_file {
            Some(path) if index == 1 => format!("parameters = {{ latency_file = {path:?} }}\n"),
            _ => String::new(),
        };
        text += &format!(
            "[process.r{index}]\ncommand = [{binary:?}, \"relay-process\", \"{bytes}\"]\nwait = \"{wait}\"\n\
             {cpu}{parameters}inputs.input = {{ topic = \"/r{before}/output\"{delay} }}\n\
             outputs.output = {{ type = \"{type_name}\" }}\n"
        );
    }
    Ok(text)
}
