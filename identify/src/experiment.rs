//! Effects that look alike on some flights, and what would tell them apart.

/// The experiment that tells `a` from `b`.
#[must_use]
pub fn between(a: &str, b: &str) -> &'static str {
    let is = |x: &str, y: &str| (a == x && b == y) || (a == y && b == x);
    if is("thrust-scale", "mass-error") {
        "weigh the vehicle; or fly with a known weight added: the relative error of the mass shrinks, that of thrust \
         stays"
    } else if is("command-delay", "motor-lag") {
        "log rotor speeds, or command steps on a thrust stand at 1 kHz: a delay waits, a lag starts at once"
    } else if is("command-delay", "sensor-delay") {
        "log rotor speeds on the sensors' clock: they follow a delayed command, not a delayed sensor"
    } else if is("rotor-drag", "blade-flapping") {
        "fly the same speeds with a heavier load: flapping grows with thrust, rotor drag with rotor speed"
    } else if is("rotor-drag", "parasitic-drag") {
        "fly at twice the speed: parasitic drag grows with its square"
    } else if is("thrust-scale", "battery-sag") || is("battery-sag", "mass-error") {
        "log the voltage, and fly from a full battery until it is nearly empty"
    } else if is("weak-rotor", "com-offset") {
        "turn the propellers round by one motor: a weak rotor moves with them, the centre of mass does not"
    } else if is("mass-error", "ground-effect") || is("thrust-scale", "ground-effect") {
        "hover at several heights from one to ten rotor radii"
    } else {
        "fly manoeuvres in which the two differ: other speeds, rates, heights or loads than in these flights"
    }
}
