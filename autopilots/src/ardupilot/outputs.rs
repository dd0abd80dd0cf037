//! The firmware's packet: a magic number, its rate, a frame count, and a pulse for each channel, little-endian.

/// Channels of the longer packet.
pub const CHANNELS_MAX: usize = 32;
/// Magic numbers, by the number of channels.
const MAGIC: [(usize, u16); 2] = [(16, 18458), (CHANNELS_MAX, 29569)];
/// Bytes before the pulses: the magic number, the rate and the frame count.
const HEAD: usize = 8;

/// Outputs of the firmware at a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Outputs {
    /// Number of the frame.
    pub frame: u32,
    /// Pulses by channel, us; 0 where there is none.
    pub pulse_us: [u16; CHANNELS_MAX],
}

impl Outputs {
    /// Reads a packet.
    ///
    /// # Errors
    /// Its length or its magic number is another one.
    pub fn read(bytes: &[u8]) -> Result<Self, String> {
        let word = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
        let length = |channels: usize| HEAD + 2 * channels;
        let Some((channels, magic)) =
            MAGIC.into_iter().find(|(channels, _)| bytes.len() == length(*channels))
        else {
            let [short, long] =
                MAGIC.map(|(channels, _)| format!("{} ({channels} channels)", length(channels)));
            return Err(format!("it sent a packet of {} bytes, expected {short} or {long}", bytes.len()));
        };
        if word(0) != magic {
            let found = word(0);
            return Err(format!(
                "it sent a packet of {channels} channels with the magic number {found}, expected {magic}"
            ));
        }
        let mut pulse_us = [0; CHANNELS_MAX];
        for (channel, pulse_us) in pulse_us.iter_mut().take(channels).enumerate() {
            *pulse_us = word(HEAD + 2 * channel);
        }
        Ok(Self { frame: u32::from(word(4)) | (u32::from(word(6)) << 16), pulse_us })
    }

    /// These outputs, if they are newer than those of frame `last`; `None` if they are the same frame, sent again.
    ///
    /// # Errors
    /// The frame count went back.
    pub fn after(self, last: u32) -> Result<Option<Self>, String> {
        if self.frame < last {
            let found = self.frame;
            return Err(format!(
                "its frame count went back from {last} to {found}, expected {}: it has started anew",
                last + 1
            ));
        }
        Ok((self.frame > last).then_some(self))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn packet(magic: u16, frame: u32, channels: u16) -> Vec<u8> {
        let words = [magic, 400, 0, 0].into_iter().chain((0..channels).map(|channel| 1000 + channel));
        let mut bytes: Vec<u8> = words.flat_map(u16::to_le_bytes).collect();
        bytes[4..8].copy_from_slice(&frame.to_le_bytes());
        bytes
    }

    #[test]
    fn packets_of_16_and_32_channels_are_read() {
        for (magic, channels) in [(18458, 16), (29569, 32)] {
            let outputs = Outputs::read(&packet(magic, 70_000, channels)).unwrap();
            assert_eq!((outputs.frame, outputs.pulse_us[15]), (70_000, 1015));
            assert_eq!(outputs.pulse_us[31], if channels == 32 { 1031 } else { 0 });
        }
    }

    #[test]
    fn other_packets_are_refused_in_words() {
        let refused = |bytes: &[u8]| Outputs::read(bytes).unwrap_err();
        let error = refused(&packet(29569, 0, 16));
        assert!(error.contains("magic number 29569, expected 18458"), "{error}");
        for length in [0, 1, 39, 41, 71, 73] {
            let error = refused(&vec![0; length]);
            assert!(error.contains(&format!("{length} bytes, expected 40 (16 channels) or 72")), "{error}");
        }
    }

    #[test]
    fn a_frame_counts_once_and_never_goes_back() {
        let outputs = Outputs::read(&packet(18458, 7, 16)).unwrap();
        assert_eq!(outputs.clone().after(7), Ok(None));
        assert_eq!(outputs.clone().after(6).unwrap().unwrap().frame, 7);
        let error = outputs.after(8).unwrap_err();
        assert!(error.contains("from 8 to 7, expected 9"), "{error}");
    }
}
