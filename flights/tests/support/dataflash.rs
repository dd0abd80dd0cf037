//! Dataflash logs as ArduPilot writes them.

const FMT: u8 = 128;
const FMTU: u8 = 130;
const MULT: u8 = 131;
const ATT: u8 = 10;
const IMU: u8 = 11;
const RCOU: u8 = 12;
const BAT: u8 = 13;

/// A flight of `count` samples at 100 Hz that rolls to and fro; with FMTU and MULT or, as old logs, without.
pub fn log(count: u32, has_units: bool) -> Vec<u8> {
    let mut bytes = [
        fmt(FMT, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns"),
        fmt(FMTU, 3 + 8 + 1 + 32, "FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds"),
        fmt(MULT, 3 + 8 + 1 + 8, "MULT", "Qbd", "TimeUS,Id,Mult"),
        fmt(ATT, 3 + 8 + 6, "ATT", "QccC", "TimeUS,Roll,Pitch,Yaw"),
        fmt(IMU, 3 + 8 + 1 + 24, "IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
        fmt(RCOU, 3 + 8 + 8, "RCOU", "QHHHH", "TimeUS,C1,C2,C3,C4"),
        fmt(BAT, 3 + 8 + 2 + 4, "BAT", "QHZ", "TimeUS,Volt,Text"),
    ]
    .concat();
    // The text of BAT is longer than its messages: such a format is none.
    bytes.extend(fmt(BAT, 3 + 8 + 2 + 4, "BAT", "QHn", "TimeUS,Volt,Text"));
    if has_units {
        for (letter, factor) in [(b'-', 0.0), (b'0', 1.0), (b'B', 1e-2), (b'C', 1e-3), (b'F', 1e-6)] {
            bytes.extend(message(
                MULT,
                &[&0_u64.to_le_bytes()[..], &[letter], &f64::to_le_bytes(factor)].concat(),
            ));
        }
        for (kind, units, multipliers) in [
            (ATT, "sddh", "FBBB"),
            (IMU, "s#EEEooo", "F-000000"),
            (RCOU, "sYYYY", "F----"),
            (BAT, "sv-", "FC-"),
        ] {
            let text = [padded(units, 16), padded(multipliers, 16)].concat();
            bytes.extend(message(FMTU, &[&0_u64.to_le_bytes()[..], &[kind], &text].concat()));
        }
    }
    for k in 0..count {
        let t = 0.01 * f64::from(k);
        let stamp = (60_000_000 + 10_000 * u64::from(k)).to_le_bytes();
        let roll = (1000.0 * libm::sin(2.0 * t)).round() as i16;
        let angles = [roll.to_le_bytes(), 0_i16.to_le_bytes(), 9000_i16.to_le_bytes()].concat();
        bytes.extend(message(ATT, &[&stamp[..], &angles].concat()));
        for sensor in [0, 1] {
            let rate = 10_f64.to_radians() * 2.0 * libm::cos(2.0 * t) + 0.1 * f64::from(sensor);
            let numbers = [rate as f32, 0.0, 0.0, 0.001 * k as f32, 0.0, -9.8];
            let numbers: Vec<u8> = numbers.into_iter().flat_map(f32::to_le_bytes).collect();
            bytes.extend(message(IMU, &[&stamp[..], &[sensor], &numbers].concat()));
        }
        let outputs: Vec<u8> = [1500_u16, 1501, 1502, 1503].into_iter().flat_map(u16::to_le_bytes).collect();
        bytes.extend(message(RCOU, &[&stamp[..], &outputs].concat()));
        bytes.extend(message(BAT, &[&stamp[..], &11_100_u16.to_le_bytes(), b"text"].concat()));
    }
    bytes
}

/// A message of the type `kind`.
pub fn message(kind: u8, body: &[u8]) -> Vec<u8> {
    [&[0xA3, 0x95, kind], body].concat()
}

/// The description of a type of message.
pub fn fmt(kind: u8, length: u8, name: &str, format: &str, names: &str) -> Vec<u8> {
    message(FMT, &[vec![kind, length], padded(name, 4), padded(format, 16), padded(names, 64)].concat())
}

fn padded(text: &str, length: usize) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    bytes.resize(length, 0);
    bytes
}
