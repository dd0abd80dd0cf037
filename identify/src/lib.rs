//! Closing the loop: what real flights show that the declared model lacks.
//!
//! Measurement and model are put into the same equations of motion, seen through the same smooth window
//! ([`window`], [`prepared`], [`model`]); what is left is regressed on the candidates' effects ([`fit`]), and judged on
//! flights that nothing was fitted on ([`select`]).
//!
//! | room | what it holds |
//! |---|---|
//! | [`run`] | the whole way, from flights to a report |
//! | [`clock`], [`track`] | measured channels on a grid of instants |
//! | [`window`] | the window, and differences that lose nothing |
//! | [`prepared`] | a flight and the equations that it allows |
//! | [`model`] | the model's side of the equations |
//! | [`parameter`], [`candidate`] | what may be changed of the model, and by which effect |
//! | [`normal`], [`fit`] | least squares over blocks of time |
//! | [`select`] | attribution: which effects the flights ask for |
//! | [`align`], [`faults`], [`trim`] | clocks, sensors and trims, before anything is fitted |
//! | [`sensing`] | the sensors' delays and biases, and a flight without them |
//! | [`whiteness`], [`noise`], [`statistics`] | what is left, and what noise alone would leave |
//! | [`predict`] | prediction over horizons |
//! | [`regressor`] | what residuals are looked at against |
//! | [`report`], [`vehicle_file`], [`experiment`] | what is written down |
//! | [`rotor`] | the rotor from a thrust stand |

pub mod align;
pub mod candidate;
pub mod clock;
pub mod faults;
pub mod fit;
pub mod model;
pub mod noise;
pub mod normal;
pub mod parameter;
pub mod predict;
pub mod prepared;
pub mod regressor;
pub mod report;
pub mod rotor;
pub mod rows;
pub mod run;
pub mod select;
pub mod sensing;
pub mod sensor_effects;
pub mod statistics;
pub mod track;
pub mod trim;
pub mod vehicle_file;
pub mod whiteness;
pub mod window;
