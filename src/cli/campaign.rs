//! The command `campaign`: thousands of flights of one manifest, each with other values.

use super::campaign_engine::{EngineArguments, Flight, fly_task};
use super::interrupts::stop_token;
use super::output::{print_json, print_text, say};
use super::progress;
use anyhow::{Context, Result, bail};
use campaign::base::Base;
use campaign::declaration::Campaign;
use campaign::plan::Plan;
use campaign::report::Report;
use campaign::requirement::Requirement;
use campaign::row::{Row, columns};
use campaign::store::{PLAN, Store};
use campaign::worker::{Job, Order, VERSION, serve, take_output};
use campaign::{page, table};
use clap::Args;
use hummingbus::COMPONENTS;
use inputs::InputFiles;
use report::summary::Summary;
use runtime::graph::Graph;
use runtime::host::Host;
use runtime::launcher::Launcher;
use serde_json::json;
use std::collections::BTreeMap;
use std::io::{Write as _, stdin};
use std::path::{Path, PathBuf};

pub const HELP: &str = "Example: hummingbus campaign manifests/campaigns/hover-robustness.toml --out robustness\n\n\
                        Writes plan.csv, flights.parquet, report.json and report.html into the folder. The same command goes \
                        on where an earlier one was interrupted. docs/campaigns.md has the keys of campaign files.";

/// The page of the report.
const PAGE: &str = "report.html";
/// Progress of a campaign.
const BAR: &str = "{bar:30} {pos}/{len} flights  {rate}, {left} left  {msg}";
/// Flights that are checked before the first one is flown.
const CHECKED: usize = 3;

/// Arguments of `campaign`.
#[derive(Args)]
pub struct CampaignArguments {
    /// The campaign file.
    #[arg(required_unless_present_any = ["worker", "task_of"])]
    campaign: Option<PathBuf>,
    /// Folder for the plan, the flights and the report; named like the campaign file where absent.
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    #[command(flatten)]
    engine: EngineArguments,
    /// Draw and write the plan, and fly nothing.
    #[arg(long, conflicts_with = "require")]
    plan_only: bool,
    /// Fly one flight of the plan again, recorded into the folder, and judge it as `run` does.
    #[arg(long, value_name = "FLIGHT", conflicts_with_all = ["plan_only", "require", "workers"])]
    fly: Option<usize>,
    /// Exit with code 1 unless this holds, such as "pass_rate >= 0.99 at 95 %".
    #[arg(long, value_name = "CONDITION")]
    require: Option<Requirement>,
    /// Print the report as JSON, and no progress.
    #[arg(long)]
    json: bool,
    /// Fly for a campaign that started this process.
    #[arg(long, hide = true)]
    worker: bool,
    /// Fly a chunk for a campaign that submitted this task.
    #[arg(long, hide = true, value_name = "FOLDER")]
    task_of: Option<PathBuf>,
}

/// Campaign to fly, and the way to fly it.
pub struct Flying {
    /// The campaign file.
    pub path: PathBuf,
    /// Its text.
    pub text: String,
    /// Folder for the plan, the flights and the report.
    pub folder: PathBuf,
    /// True if the text is to be written to the path, which lies in the folder.
    pub is_made: bool,
    /// Engine that flies.
    pub engine: EngineArguments,
    /// Condition for exit code 0.
    pub require: Option<Requirement>,
    /// True for a report as JSON.
    pub json: bool,
}

/// The command `campaign`; false if the requirement is not met.
///
/// # Errors
/// A problem in the campaign, its manifest or its folder, or an interrupted campaign.
pub fn campaign(arguments: &CampaignArguments) -> Result<bool> {
    if arguments.worker {
        let output = take_output().context("cannot keep standard output for answers")?;
        return serve(COMPONENTS, stdin().lock(), output).map(|()| true);
    }
    if let Some(folder) = &arguments.task_of {
        return fly_task(folder).map(|()| true);
    }
    arguments.engine.check()?;
    let path = arguments.campaign.clone().context("expected a campaign file")?;
    let text =
        InputFiles::default().text(&path).with_context(|| format!("cannot read {}", path.display()))?;
    let folder = arguments.out.clone().unwrap_or_else(|| path.with_extension(""));
    let CampaignArguments { require, json, .. } = *arguments;
    let engine = arguments.engine.clone();
    let opened = Opened::new(Flying { path, text, folder, is_made: false, engine, require, json })?;
    if arguments.plan_only {
        let path = opened.0.flying.folder.join(PLAN);
        return print_text(&format!("{} flights: {}", opened.0.plan.flights.len(), path.display()))
            .map(|()| true);
    }
    match arguments.fly {
        Some(flight) => fly_one(&opened.0, flight),
        None => fly_all(opened),
    }
}

/// Flies a campaign to its end, and reports it; false if its requirement is not met.
///
/// # Errors
/// As [`campaign`].
pub fn fly(flying: Flying) -> Result<bool> {
    fly_all(Opened::new(flying)?)
}

fn fly_all((mut opened, flown): (Opened, BTreeMap<u64, Row>)) -> Result<bool> {
    let rows = opened.fly(flown)?;
    let report = opened.write(&rows)?;
    judge(&opened, &report)
}

/// A campaign with its folder.
struct Opened {
    flying: Flying,
    campaign: Campaign,
    base: Base,
    figures: Vec<String>,
    store: Store,
    plan: Plan,
}

impl Opened {
    /// The campaign, and the rows that were flown already.
    fn new(flying: Flying) -> Result<(Self, BTreeMap<u64, Row>)> {
        let Flying { path, text, folder, .. } = &flying;
        let campaign = Campaign::parse(path, text)?;
        let base = Base::read(&campaign, COMPONENTS)?;
        let figures = columns(&base.manifest.content);
        let (store, plan, flown) = Store::open(folder, &campaign, &base.fingerprint, &figures)?;
        if let (true, Some(name)) = (flying.is_made, path.file_name().and_then(|name| name.to_str())) {
            store.write(name, |file| Ok(file.write_all(text.as_bytes())?))?;
        }
        Ok((Self { flying, campaign, base, figures, store, plan }, flown))
    }

    /// Flies the flights that have no row yet; all rows by flight.
    fn fly(&mut self, mut rows: BTreeMap<u64, Row>) -> Result<BTreeMap<u64, Row>> {
        let jobs = jobs(&self.campaign, &self.base, &self.plan, &rows)?;
        require_flyable(&self.base, &jobs)?;
        let (flown, planned) = (rows.len() as u64, self.plan.flights.len() as u64);
        let bar = progress::bar_from(BAR, flown, planned, self.flying.json);
        let Self { flying, campaign, base, plan, figures, store } = self;
        let (path, text, fingerprint) = (flying.path.clone(), flying.text.clone(), base.fingerprint.clone());
        let order =
            Order { version: VERSION.to_owned(), path, text, fingerprint, folder: store.work_folder()? };
        let flight = Flight { folder: &flying.folder, order, timeout_s_host: campaign.timeout_s_host };
        let tell = |text: &str| bar.suspend(|| say(text));
        let end = flying.engine.fly(flight, jobs, &tell, |mut row| {
            row.drawn.clone_from(&plan.flights[row.flight as usize]);
            row.figures.resize(figures.len(), None);
            store.add(&row)?;
            rows.insert(row.flight, row);
            bar.inc(1);
            Ok(())
        });
        progress::finish(&bar);
        end.with_context(|| format!("{} flights are kept in {}", rows.len(), self.flying.folder.display()))?;
        Ok(rows)
    }

    /// Writes the table and the report.
    fn write(&self, rows: &BTreeMap<u64, Row>) -> Result<Report> {
        let rows: Vec<Row> = rows.values().cloned().collect();
        let report = Report::of(&self.campaign, &self.base, &self.plan, &rows, &self.flying.folder)?;
        let Self { store, plan, figures, .. } = self;
        store.write("flights.parquet", |file| table::write(file, plan, figures, &rows))?;
        store.write("report.json", |file| Ok(serde_json::to_writer_pretty(file, &report)?))?;
        store.write(PAGE, |file| Ok(file.write_all(&page::page(&report, plan, figures, &rows))?))?;
        Ok(report)
    }
}

/// Prints the report, and says if the requirement holds.
fn judge(opened: &Opened, report: &Report) -> Result<bool> {
    let Flying { folder, require, json, .. } = &opened.flying;
    let is_met = require.is_none_or(|required| required.is_met(report.passed, report.flights));
    if *json {
        let mut value = json!(report);
        value["requirement_met"] = json!(is_met);
        print_json(&value)?;
    } else {
        print_text(&format!("{report}{}", next_steps(folder, report)))?;
    }
    let left = report.planned - report.flights;
    if left > 0 {
        bail!("the campaign was interrupted; the same command flies the other {left} flights");
    }
    if let Some(required) = require.filter(|_| !is_met) {
        let shown = required.shown(report.passed, report.flights);
        say(&format!("not met: {required}; these flights show {shown:.4}"));
    }
    Ok(is_met)
}

/// Last lines of the summary: the page, and the command that flies the worst flight again.
fn next_steps(folder: &Path, report: &Report) -> String {
    let page = format!("report: {}", folder.join(PAGE).display());
    let Some(worst) = report.worst.first() else { return page };
    format!("to fly the worst again, recorded: {}\n{page}", worst.command)
}

/// Flies flight number `flight` of the plan on this thread, recorded; false if a condition does not hold.
fn fly_one(opened: &Opened, flight: usize) -> Result<bool> {
    let Opened { flying: Flying { folder, json, .. }, campaign, base, plan, .. } = opened;
    if flight >= plan.flights.len() {
        bail!("there is no flight {flight}: the plan has the flights 0 to {}", plan.flights.len() - 1);
    }
    let recording = std::path::absolute(folder.join(format!("flight-{flight}.mcap")))?;
    let record = toml::Value::from(recording.to_string_lossy().into_owned());
    let sets = [plan.sets(campaign, base, flight)?, vec![format!("run.record={record}")]].concat();
    let manifest = base.of_flight(&sets)?;
    let graph = Graph::build_from(&manifest, base.files.branch())?;
    let mut launcher = Launcher::new(Host::InProcess).stopped_by(&stop_token()?).reading(base.files.branch());
    if let Some(from) = &base.from {
        launcher = launcher.going_on_from(from.clone());
    }
    let (mut outcome, flown) = launcher.fly(&manifest, &recording)?;
    let figures = outcome.figures.take();
    let mut summary =
        Summary::new(format!("{} flight {flight}", manifest.name()), outcome, graph.plan.tick_s());
    let flown = flown.context("the manifest has no recorder: add one to see a flight")?;
    match figures {
        // The judge has seen the flight before the checkpoint, too.
        Some(figures) => {
            summary.judge_by(&figures, &manifest.content)?;
            summary.describe(&flown, &graph.plan)?;
        }
        None => summary.judge(&flown, &graph.plan, &manifest.content)?,
    }
    if *json {
        print_json(&serde_json::to_value(&summary)?)?;
    } else {
        print_text(&summary.to_string())?;
    }
    Ok(summary.passed)
}

/// The flights of the plan that have no row yet.
fn jobs(campaign: &Campaign, base: &Base, plan: &Plan, flown: &BTreeMap<u64, Row>) -> Result<Vec<Job>> {
    let missing = (0..plan.flights.len()).filter(|flight| !flown.contains_key(&(*flight as u64)));
    missing
        .map(|flight| Ok(Job { flight: flight as u64, sets: plan.sets(campaign, base, flight)? }))
        .collect()
}

/// Refuses a campaign whose first flights are all refused, as they are where no manifest has a varied key.
fn require_flyable(base: &Base, jobs: &[Job]) -> Result<()> {
    let mut refusals = jobs.iter().take(CHECKED).map(|job| base.check(&job.sets));
    match refusals.next() {
        Some(Err(error)) if refusals.all(|refusal| refusal.is_err()) => {
            Err(error).context(format!("flight {} and the next ones are refused", jobs[0].flight))
        }
        _ => Ok(()),
    }
}
