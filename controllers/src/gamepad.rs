//! A gamepad, or a transmitter with a USB plug, by the joystick interface of Linux (`linux/joystick.h`, `/dev/input/js0`).
//!
//! The kernel sends the position of each axis and button when the device is opened, and each change after that. No library is needed.

use crate::pulses::{HIGH_US, LOW_US, check_channel, check_pulse};
use component::messages::RC_CHANNELS_MAX;
use diagnostics::parameter::{ParameterError, refuse, require};
use std::collections::BTreeSet;
use std::fmt::Display;
use std::fs::{File, Metadata, OpenOptions};
use std::io::{self, ErrorKind, Read};
use std::os::unix::fs::{FileTypeExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Size of an event: time in ms (4 bytes), value (2), kind (1), number of the axis or button (1).
const EVENT_BYTES: usize = 8;
/// Kinds of events.
const BUTTON: u8 = 1;
const AXIS: u8 = 2;
/// Mark of an event that has a position at the opening.
const INITIAL: u8 = 0x80;
/// Events that are read at once.
const EVENTS: usize = 64;
/// Such readings within a step: a device that sends on and on stops no run.
const READS_MAX: usize = 16;
/// Greatest number of an axis or button.
const NUMBER_MAX: f64 = 255.0;
/// `O_NONBLOCK` of Linux.
const NONBLOCK: i32 = 0o4000;
/// Input devices of Linux, and the joysticks among them.
const INPUT_MAJOR: u64 = 13;
const JOYSTICK_MINORS: u64 = 32;

/// Control of a gamepad that moves a channel.
#[derive(Clone, Copy, Debug, component::Parameters)]
pub(crate) struct Control {
    /// Number of the channel, from 1.
    #[parameter(check = check_channel)]
    channel: usize,
    /// Number of an axis of the gamepad, from 0.
    #[parameter(check = check_number)]
    axis: Option<usize>,
    /// Number of a button, from 0, in place of an axis.
    #[parameter(check = check_number)]
    button: Option<usize>,
    /// Pulses at the lower end of the axis, left or forward, or while the button is up.
    #[parameter(default = LOW_US, unit = "µs", check = check_pulse)]
    from_us: f64,
    /// Pulses at its upper end, or while the button is down.
    #[parameter(default = HIGH_US, unit = "µs", check = check_pulse)]
    to_us: f64,
    /// True if each press of the button moves the channel to its other end.
    #[parameter(default = false)]
    toggles: bool,
}

/// Requires a number that an event can have.
fn check_number(key: &str, number: f64) -> Result<(), ParameterError> {
    require(key, number, (0.0..=NUMBER_MAX).contains(&number), format!("0 to {NUMBER_MAX}"))
}

/// Event of the device.
#[derive(Clone, Copy)]
struct Event {
    value: i16,
    kind: u8,
    number: u8,
}

impl Event {
    /// Reads the event of `bytes`; `None` if they are too few.
    fn of(bytes: &[u8]) -> Option<Self> {
        let &[_, _, _, _, low, high, kind, number] = bytes else { return None };
        Some(Self { value: i16::from_ne_bytes([low, high]), kind, number })
    }
}

impl Control {
    /// Requires an axis or a button.
    fn check(&self) -> Result<(), ParameterError> {
        let channel = self.channel;
        let is_one = self.axis.is_some() != self.button.is_some();
        refuse(!is_one, "controls", || {
            format!(
                "`controls`: channel {channel} is moved by no control or two, expected an `axis` or a `button`"
            )
        })?;
        refuse(self.toggles && self.button.is_none(), "controls", || {
            format!("`controls`: channel {channel} has `toggles` with an `axis`, expected a `button`")
        })
    }

    /// Part of its way, from 0 to 1, to which `event` moves the control from `before`; `None` if the event is of another control.
    fn moved(&self, event: Event, before: Option<f64>) -> Option<f64> {
        let number = Some(usize::from(event.number));
        match event.kind & !INITIAL {
            AXIS if self.axis == number => {
                Some(0.5 + 0.5 * (f64::from(event.value) / f64::from(i16::MAX)).max(-1.0))
            }
            BUTTON if self.button == number => {
                let is_down = event.value != 0;
                if !self.toggles {
                    return Some(if is_down { 1.0 } else { 0.0 });
                }
                let is_press = is_down && event.kind & INITIAL == 0;
                let part = before.unwrap_or(0.0);
                Some(if is_press { 1.0 - part } else { part })
            }
            _ => None,
        }
    }

    fn pulse_us(&self, part: f64) -> f64 {
        self.from_us + part * (self.to_us - self.from_us)
    }
}

/// Gamepad that moves channels.
#[derive(Debug)]
pub(crate) struct Gamepad {
    device: PathBuf,
    controls: Vec<Control>,
    opened: Mutex<Opened>,
}

/// The open device. A step reads it behind a shared reference. Positions are no part of the component's state: Linux sends all of them
/// whenever the device is opened.
#[derive(Debug)]
struct Opened {
    file: File,
    /// Part of its way of each control; `None` before the device has sent it.
    parts: Vec<Option<f64>>,
}

impl Gamepad {
    /// Opens the gamepad at `device`, if there is one, whose `controls` move channels.
    ///
    /// # Errors
    /// It cannot be opened, or a control cannot be meant.
    pub(crate) fn open(
        device: Option<PathBuf>,
        controls: Vec<Control>,
    ) -> Result<Option<Self>, ParameterError> {
        let Some(device) = device else {
            let missing = "`controls` move channels by no gamepad: add `gamepad`, its device";
            return refuse(!controls.is_empty(), "controls", || missing).map(|()| None);
        };
        let idle = "`gamepad` moves no channel: add `controls`, such as `{ channel = 1, axis = 0 }`";
        let moving = refuse(controls.is_empty(), "controls", || idle);
        let checks = controls.iter().map(Control::check).chain([moving, check_channels(&controls)]);
        let (file, _) = ParameterError::both(open_joystick(&device), ParameterError::gather(checks))?;
        let parts = vec![None; controls.len()];
        Ok(Some(Self { device, controls, opened: Mutex::new(Opened { file, parts }) }))
    }

    /// Returns the channels that it moves.
    pub(crate) fn channels(&self) -> BTreeSet<usize> {
        self.controls.iter().map(|control| control.channel).collect()
    }

    /// Returns the pulses of each channel; `None` if no control moves it, or before the device has sent its position.
    ///
    /// # Errors
    /// The gamepad has gone.
    pub(crate) fn pulses_us(&self) -> Result<[Option<f64>; RC_CHANNELS_MAX], String> {
        let mut opened = self.opened.lock().unwrap_or_else(PoisonError::into_inner);
        let read = opened.read(&self.controls);
        read.map_err(|cause| {
            let device = self.device.display();
            format!("the gamepad {device} cannot be read any more: {cause}; plug it in again, and start the run anew")
        })?;
        let mut pulses_us = [None; RC_CHANNELS_MAX];
        for (control, part) in self.controls.iter().zip(&opened.parts) {
            pulses_us[control.channel - 1] = part.map(|part| control.pulse_us(part));
        }
        Ok(pulses_us)
    }
}

/// Requires each channel to be moved by one of `controls`.
fn check_channels(controls: &[Control]) -> Result<(), ParameterError> {
    let mut channels = BTreeSet::new();
    let twice = controls.iter().find(|control| !channels.insert(control.channel));
    let channel = twice.map(|control| control.channel).unwrap_or_default();
    refuse(twice.is_some(), "controls", || {
        format!(
            "`controls` move channel {channel} twice, expected one control for a channel; leave one of them out"
        )
    })
}

impl Opened {
    /// Reads the events that have come.
    fn read(&mut self, controls: &[Control]) -> io::Result<()> {
        let mut bytes = [0; EVENT_BYTES * EVENTS];
        for _ in 0..READS_MAX {
            match self.file.read(&mut bytes) {
                Ok(0) => return Err(io::Error::new(ErrorKind::UnexpectedEof, "it has gone")),
                Ok(length) => {
                    for event in bytes[..length].chunks(EVENT_BYTES).filter_map(Event::of) {
                        self.note(event, controls);
                    }
                }
                Err(cause) if cause.kind() == ErrorKind::WouldBlock => return Ok(()),
                Err(cause) if cause.kind() == ErrorKind::Interrupted => {}
                Err(cause) => return Err(cause),
            }
        }
        Ok(())
    }

    fn note(&mut self, event: Event, controls: &[Control]) {
        for (control, part) in controls.iter().zip(&mut self.parts) {
            *part = control.moved(event, *part).or(*part);
        }
    }
}

/// Opens the joystick device at `path`.
fn open_joystick(path: &Path) -> Result<File, ParameterError> {
    let refused = |cause: &dyn Display| {
        let (path, advice) = (path.display(), "plug the gamepad in, and look for its device in /dev/input");
        ParameterError::conflict("gamepad", format!("{path}: cannot open the gamepad: {cause}; {advice}"))
    };
    // The opening of some devices acts: it is looked at before.
    let metadata = path.metadata().map_err(|cause| refused(&cause))?;
    if !is_joystick(&metadata) {
        return Err(refused(&"expected a joystick device of Linux, such as /dev/input/js0"));
    }
    OpenOptions::new().read(true).custom_flags(NONBLOCK).open(path).map_err(|cause| refused(&cause))
}

/// True for a joystick device, and for a pipe that has its events.
fn is_joystick(metadata: &Metadata) -> bool {
    let (kind, device) = (metadata.file_type(), metadata.rdev());
    let (major, minor) = ((device >> 8) & 0xfff, (device & 0xff) | ((device >> 12) & 0xf_ff00));
    kind.is_fifo() || (kind.is_char_device() && major == INPUT_MAJOR && minor < JOYSTICK_MINORS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use component::Parameters as _;

    fn control(text: &str) -> Control {
        let control: Control = toml::from_str(text).unwrap();
        control.validate().unwrap();
        control
    }

    fn event(kind: u8, number: u8, value: i16) -> Event {
        let [low, high] = value.to_ne_bytes();
        Event::of(&[9, 9, 9, 9, low, high, kind, number]).unwrap()
    }

    #[test]
    fn an_axis_moves_its_channel_between_its_ends() {
        let roll = control("channel = 1\naxis = 3");
        let throttle = control("channel = 3\naxis = 1\nfrom_us = 2000.0\nto_us = 1000.0");
        let pulse_us =
            |control: &Control, event| control.moved(event, None).map(|part| control.pulse_us(part));
        for (value, expected) in [(-32768, 1000.0), (-32767, 1000.0), (0, 1500.0), (32767, 2000.0)] {
            assert_eq!(pulse_us(&roll, event(AXIS | INITIAL, 3, value)), Some(expected));
            assert_eq!(pulse_us(&throttle, event(AXIS, 1, value)), Some(3000.0 - expected));
        }
        assert_eq!(pulse_us(&roll, event(AXIS, 1, 5)), None, "another axis");
        assert_eq!(pulse_us(&roll, event(BUTTON, 3, 1)), None, "a button of that number");
        assert!(Event::of(&[0; 7]).is_none());
    }

    #[test]
    fn a_button_acts_while_it_is_down_or_at_each_press() {
        let after = |text: &str, events: &[(u8, i16)]| {
            let control = control(text);
            events.iter().fold(None, |part, (kind, value)| control.moved(event(*kind, 0, *value), part))
        };
        let momentary = "channel = 5\nbutton = 0";
        assert_eq!(after(momentary, &[(BUTTON | INITIAL, 1)]), Some(1.0));
        assert_eq!(after(momentary, &[(BUTTON, 1), (BUTTON, 0)]), Some(0.0));
        let toggle = "channel = 5\nbutton = 0\ntoggles = true";
        assert_eq!(after(toggle, &[(BUTTON | INITIAL, 1)]), Some(0.0), "held at the opening, not pressed");
        assert_eq!(after(toggle, &[(BUTTON, 1), (BUTTON, 0)]), Some(1.0));
        assert_eq!(after(toggle, &[(BUTTON, 1), (BUTTON, 0), (BUTTON, 1)]), Some(0.0));
    }

    fn refusal(device: Option<&str>, controls: &[&str]) -> String {
        let controls = controls.iter().map(|text| control(text)).collect();
        Gamepad::open(device.map(PathBuf::from), controls).unwrap_err().to_string()
    }

    #[test]
    fn devices_and_controls_that_cannot_be_meant_are_refused() {
        let roll = "channel = 1\naxis = 0";
        let faults = refusal(Some("/dev/null"), &[roll, "channel = 1\nbutton = 0", "channel = 2"]);
        for part in ["/dev/null", "joystick device", "channel 1 twice", "channel 2 is moved by no control"] {
            assert!(faults.contains(part), "{part}: {faults}");
        }
        assert!(refusal(Some("/nowhere/js0"), &[roll]).contains("/nowhere/js0: cannot open the gamepad"));
        assert!(refusal(Some("/dev/null"), &[]).contains("`gamepad` moves no channel"));
        assert!(refusal(None, &[roll]).contains("add `gamepad`"));
        assert!(refusal(Some("/dev/null"), &["channel = 1\naxis = 0\ntoggles = true"]).contains("`toggles`"));
        assert!(Gamepad::open(None, Vec::new()).unwrap().is_none());
    }
}
