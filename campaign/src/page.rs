//! The report as one HTML page that needs no network, drawn by `page.js` with plotly.js ([`report::page`]).

use crate::base::Base;
use crate::declaration::{Campaign, Varied};
use crate::list::shown;
use crate::report::Report;
use crate::row::Row;
use ::report::page::{PLOTLY_BASIC, page as html};
use serde_json::{Value, json};

/// Flights on the page at most, spread evenly over all: more would make it slow.
const SHOWN: usize = 5000;

/// The page of `report`, with the `rows` and the figures that `base` keeps.
#[must_use]
pub fn page(report: &Report, campaign: &Campaign, base: &Base, rows: &[Row]) -> Vec<u8> {
    let step = rows.len().div_ceil(SHOWN).max(1);
    let shown: Vec<Value> = rows.iter().step_by(step).map(|row| flight(campaign, base, row)).collect();
    let figures: Vec<&String> = base.kept.iter().map(|&index| &base.figures[index]).collect();
    let varied: Vec<&String> = campaign.vary.iter().map(|varied| &varied.name).collect();
    let data = json!({ "report": report, "varied": varied, "figures": figures, "flights": shown });
    html(include_str!("page/page.html"), &PLOTLY_BASIC, include_str!("page/page.js"), &data)
}

fn flight(campaign: &Campaign, base: &Base, row: &Row) -> Value {
    let figures: Vec<Option<f64>> =
        base.kept.iter().map(|&index| row.figures.get(index).copied().flatten()).collect();
    let value = |(varied, drawn): (&Varied, &f64)| match varied.distribution.choice(*drawn) {
        Some(choice) => json!(shown(choice)),
        None => json!(drawn),
    };
    let drawn: Vec<Value> = campaign.vary.iter().zip(&row.drawn).map(value).collect();
    json!({ "flight": row.flight, "passed": row.passed, "drawn": drawn, "figures": figures })
}
