//! Mixers of Betaflight by the names of its command line, with their motors in its order (`src/main/flight/mixer_init.c`).

use crate::layout::Frame;

/// The mixers.
pub const MIXERS: [Frame; 9] = [
    ("QUADX", &[(135.0, true), (45.0, false), (-135.0, false), (-45.0, true)]),
    ("QUADP", &[(180.0, true), (90.0, false), (-90.0, false), (0.0, true)]),
    ("HEX6X", &[(150.0, false), (30.0, false), (-150.0, true), (-30.0, true), (90.0, true), (-90.0, false)]),
    ("HEX6", &[(120.0, false), (60.0, true), (-120.0, false), (-60.0, true), (0.0, false), (180.0, true)]),
    (
        "OCTOFLATX",
        &[
            (-67.5, false),
            (22.5, false),
            (112.5, false),
            (-157.5, false),
            (-22.5, true),
            (67.5, true),
            (157.5, true),
            (-112.5, true),
        ],
    ),
    (
        "OCTOFLATP",
        &[
            (-45.0, false),
            (45.0, false),
            (135.0, false),
            (-135.0, false),
            (0.0, true),
            (90.0, true),
            (180.0, true),
            (-90.0, true),
        ],
    ),
    // Coaxial pairs: the upper rotors first.
    ("Y6", &[(180.0, false), (60.0, true), (-60.0, true), (180.0, true), (60.0, false), (-60.0, false)]),
    (
        "OCTOX8",
        &[
            (135.0, true),
            (45.0, false),
            (-135.0, false),
            (-45.0, true),
            (135.0, false),
            (45.0, true),
            (-135.0, true),
            (-45.0, false),
        ],
    ),
    (
        "OCTOX8P",
        &[
            (180.0, true),
            (90.0, false),
            (-90.0, false),
            (0.0, true),
            (180.0, false),
            (90.0, true),
            (-90.0, true),
            (0.0, false),
        ],
    ),
];
