//! Every file of a flights file is read once, and whoever needs one again gets the same bytes.

use crate::support;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use flights::FlightSet;
use support::{Motion, Place};

const FLIGHTS: &str = r#"
vehicle = "vehicle.toml"
[channels]
time = { columns = ["t"], unit = "s" }
command = { columns = ["m1", "m2", "m3", "m4"], unit = "count" }
position = { columns = ["px", "py", "pz"], unit = "m" }
attitude = { columns = ["qx", "qy", "qz", "qw"] }
angular_velocity = { columns = ["wx", "wy", "wz"], unit = "rad/s" }
[[flight]]
name = "first"
file = "log.csv"
role = "fit"
to_s = 4.0
[[flight]]
name = "second"
file = "log.csv"
role = "test"
from_s = 5.0
[[flight]]
name = "third"
file = "./log.csv"
role = "fit"
to_s = 3.0
"#;

const ON_BASE: &str = "name = \"another\"\nbase = \"base.toml\"\n";

#[test]
fn a_log_is_read_once_however_many_flights_are_in_it() {
    let reads: RefCell<BTreeMap<String, u32>> = RefCell::default();
    let read = |path: &Path| {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let bytes = match name.as_str() {
            "vehicle.toml" => ON_BASE.into(),
            "base.toml" => vehicles::reference::HUMMINGBIRD.into(),
            _ => Motion::default().csv().into_bytes(),
        };
        *reads.borrow_mut().entry(name).or_default() += 1;
        Ok(bytes)
    };
    let set = FlightSet::parse("flights.toml".as_ref(), FLIGHTS.replace("./log", "log"), &read).unwrap();
    assert_eq!(set.flights.len(), 3);
    let once = ["base.toml", "log.csv", "vehicle.toml"].map(|name| (name.to_owned(), 1));
    assert_eq!(*reads.borrow(), BTreeMap::from(once));
}

#[test]
fn a_vehicle_that_was_read_stays_as_it_was_read() {
    let place = Place::new();
    place.write("log.csv", Motion::default().csv().as_bytes());
    place.write("vehicle.toml", ON_BASE.as_bytes());
    place.write("base.toml", vehicles::reference::HUMMINGBIRD.as_bytes());
    place.write("flights.toml", FLIGHTS.as_bytes());
    let set = FlightSet::load(&place.path("flights.toml")).unwrap();
    let heavier = vehicles::reference::HUMMINGBIRD.replacen("value = 0.480", "value = 0.600", 1);
    fs::write(place.path("base.toml"), heavier).unwrap();
    fs::remove_file(place.path("vehicle.toml")).unwrap();
    let vehicle = vehicles::Vehicle::load_from(&set.files, &set.vehicle).unwrap();
    assert_eq!((&*vehicle.name, vehicle.mass_kg), ("another", 0.48));
}
