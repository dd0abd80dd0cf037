//! The command `campaign`: thousands of flights of one manifest, each with other values.

use super::campaign_engine::{EngineArguments, Flight, build, fly_task};
use super::files::require_kind;
use super::interrupts::stop_token;
use super::kind::Kind;
use super::output::{print_json, print_text, say};
use super::progress::{self, FlightLines};
use anyhow::{Context, Result, bail};
use campaign::base::{Base, together};
use campaign::declaration::Campaign;
use campaign::measures::changed;
use campaign::page;
use campaign::plan::Plan;
use campaign::report::{Report, flights};
use campaign::requirement::Requirement;
use campaign::row::Row;
use campaign::store::{Builds, Header, PLAN, Store};
use campaign::table::Table;
use campaign::worker::{Job, Order, serve, take_output};
use clap::Args;
use diagnostics::Diagnostic;
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
/// Flights that are checked at most before the first one is flown, until one is not refused.
const CHECKED: usize = 100;
/// Flights that are checked at most with each text or truth value, until one is not refused.
const CHECKED_OF_CHOICE: usize = 5;
/// Step between two checked flights, as a part of the plan: multiples of the golden ratio fill it evenly, and fall in step with no
/// grid.
const STEP: f64 = 0.618_033_988_749_894_9;

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
    /// Print no progress.
    #[arg(short, long)]
    quiet: bool,
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
    /// Text that is to be written to the path, which lies in the folder; `None` if the user wrote the file.
    pub made: Option<String>,
    /// Engine that flies.
    pub engine: EngineArguments,
    /// Condition for exit code 0.
    pub require: Option<Requirement>,
    /// True for a report as JSON.
    pub json: bool,
    /// True for no progress.
    pub quiet: bool,
}

/// The command `campaign`; false if the requirement is not met.
///
/// # Errors
/// A problem in the campaign, its manifest or its folder, or an interrupted campaign.
pub fn campaign(arguments: &CampaignArguments) -> Result<bool> {
    if arguments.worker {
        let output = take_output().context("cannot keep standard output for answers")?;
        return serve(COMPONENTS, &build()?, stdin().lock(), output).map(|()| true);
    }
    if let Some(folder) = &arguments.task_of {
        return fly_task(folder).map(|()| true);
    }
    arguments.engine.check()?;
    let path = arguments.campaign.clone().context("expected a campaign file")?;
    require_kind(&path, &[Kind::Campaign], "")?;
    let text =
        InputFiles::default().text(&path).with_context(|| format!("cannot read {}", path.display()))?;
    let folder = arguments.out.clone().unwrap_or_else(|| path.with_extension(""));
    let CampaignArguments { require, json, quiet, .. } = *arguments;
    let engine = arguments.engine.clone();
    let builds = if arguments.fly.is_some() { Builds::Any } else { Builds::Same };
    let opened =
        Opened::new(Flying { path, text, folder, made: None, engine, require, json, quiet }, builds)?;
    if arguments.plan_only {
        let path = opened.0.flying.folder.join(PLAN);
        let planned = flights(opened.0.plan.flights.len() as u64);
        return print_text(&format!("{planned}: {}", path.display())).map(|()| true);
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
    fly_all(Opened::new(flying, Builds::Same)?)
}

fn fly_all((mut opened, mut rows): (Opened, BTreeMap<u64, Row>)) -> Result<bool> {
    let flown = match opened.fly(&mut rows) {
        Err(error) if rows.is_empty() => return Err(error),
        flown => flown,
    };
    let rows: Vec<Row> = rows.into_values().collect();
    let Opened { campaign, base, plan, flying, build, .. } = &opened;
    let report = Report::of(campaign, base, plan, &rows, &flying.folder, build)?;
    let failures = opened.write(&rows, &report);
    // A file that cannot be written must not cost the verdict.
    let is_met = judge(&opened, &report, failures.is_empty());
    failures.iter().for_each(|failure| say(&format!("error: {failure:#}")));
    // The reason for the flights that are missing.
    flown?;
    if let (Err(error), false) = (&is_met, failures.is_empty()) {
        say(&format!("error: {error:#}"));
    }
    match failures.len() {
        0 => is_met,
        count => bail!(
            "{count} of 3 files were not written; the rows are kept, and the same command writes the files"
        ),
    }
}

/// A campaign with its folder.
struct Opened {
    flying: Flying,
    campaign: Campaign,
    base: Base,
    build: String,
    store: Store,
    plan: Plan,
}

impl Opened {
    /// The campaign, and the rows that were flown already.
    fn new(flying: Flying, builds: Builds) -> Result<(Self, BTreeMap<u64, Row>)> {
        let Flying { path, text, folder, .. } = &flying;
        let (campaign, base) = Base::of_campaign(path, text, COMPONENTS)?;
        let header = Header {
            build: build()?,
            fingerprint: base.fingerprint.clone(),
            figures: base.figures.clone(),
            verdicts: base.verdicts.clone(),
        };
        if !folder.exists() {
            // Refused before a folder is made for it.
            require_flyable(&campaign, &base, &Plan::of(&campaign))?;
        }
        let (store, plan, flown) = Store::open(folder, &campaign, &header, builds)?;
        if let (Some(made), Some(name)) = (&flying.made, path.file_name().and_then(|name| name.to_str())) {
            store.write(name, |file| Ok(file.write_all(made.as_bytes())?))?;
        }
        Ok((Self { flying, campaign, base, build: header.build, store, plan }, flown))
    }

    /// Flies the flights that have no row in `rows` yet, and adds each row that is kept.
    fn fly(&mut self, rows: &mut BTreeMap<u64, Row>) -> Result<()> {
        let jobs = jobs(&self.campaign, &self.base, &self.plan, rows)?;
        if rows.is_empty() {
            require_flyable(&self.campaign, &self.base, &self.plan)?;
        }
        let (flown, planned) = (rows.len() as u64, self.plan.flights.len() as u64);
        let is_quiet = self.flying.json || self.flying.quiet;
        let bar = progress::bar_from(BAR, flown, planned, is_quiet);
        let mut lines = (bar.is_hidden() && !is_quiet).then_some(FlightLines::new(flown));
        let Self { flying, campaign, base, plan, build, store } = self;
        let (path, text, fingerprint) = (flying.path.clone(), flying.text.clone(), base.fingerprint.clone());
        let order = Order { build: build.clone(), path, text, fingerprint, folder: store.work_folder()? };
        let flight = Flight { folder: &flying.folder, order, timeout_s_host: campaign.timeout_s_host };
        let tell = |text: &str| bar.suspend(|| say(text));
        let mut is_written = true;
        let end = flying.engine.fly(flight, jobs, &tell, |mut row| {
            row.drawn.clone_from(&plan.flights[row.flight as usize]);
            row.figures.resize(base.figures.len(), None);
            store.add(&row).inspect_err(|_| is_written = false)?;
            rows.insert(row.flight, row);
            bar.inc(1);
            let flown = rows.len() as u64;
            if let Some(line) = lines.as_mut().and_then(|lines| lines.due(flown, planned, bar.elapsed())) {
                say(&line);
            }
            Ok(())
        });
        progress::finish(&bar);
        end.with_context(|| {
            let kept = format!("{} kept in {}", flights(rows.len() as u64), self.flying.folder.display());
            if is_written { kept } else { format!("{kept}; the same command flies the rest") }
        })
    }

    /// Writes the table and the report; the failures of those that cannot be written.
    fn write(&self, rows: &[Row], report: &Report) -> Vec<anyhow::Error> {
        let Self { store, campaign, base, .. } = self;
        let written = [
            store.write("flights.parquet", |file| self.table(rows)?.write(file)),
            store.write("report.json", |file| Ok(serde_json::to_writer_pretty(file, report)?)),
            store.write(PAGE, |file| Ok(file.write_all(&page::page(report, campaign, base, rows))?)),
        ];
        written.into_iter().filter_map(Result::err).collect()
    }

    fn table<'a>(&'a self, rows: &'a [Row]) -> Result<Table<'a>> {
        let Self { campaign, base, plan, build, .. } = self;
        let seeds = rows.iter().map(|row| plan.seed(campaign, base, row.flight as usize));
        Ok(Table {
            varied: &campaign.vary,
            verdicts: &base.verdicts,
            figures: &base.figures,
            units: &base.units,
            kept: &base.kept,
            build,
            rows,
            seeds: seeds.collect::<Result<_>>()?,
        })
    }
}

/// Prints the report, and says if the requirement holds.
fn judge(opened: &Opened, report: &Report, has_page: bool) -> Result<bool> {
    let Flying { folder, require, json, .. } = &opened.flying;
    let verdict = verdict(*require, report);
    if *json {
        let mut value = json!(report);
        let is_whole = report.flights == report.planned;
        value["requirement_met"] = json!(require.and(verdict).filter(|_| is_whole));
        print_json(&value)?;
    } else {
        print_text(&format!("{report}{}", next_steps(folder, report, has_page)))?;
    }
    let left = report.planned - report.flights;
    if left > 0 {
        bail!("the campaign was interrupted; the same command flies the other {}", flights(left));
    }
    let Some(is_met) = verdict else {
        bail!(
            "the host ended {}, without which there is no verdict; the same command flies them again",
            flights(report.lost)
        );
    };
    if let Some(required) = require.filter(|_| !is_met) {
        say(&format!("not met: {required}; {}", required.shown_in_words(report.passed, report.flights)));
    }
    Ok(is_met)
}

/// True if the requirement holds, or there is none; `None` while flights that were not flown to their end could change that.
fn verdict(require: Option<Requirement>, report: &Report) -> Option<bool> {
    let open = report.planned - report.flights + report.lost;
    let Some(required) = require else { return (open == 0).then_some(true) };
    // The open flights count as failed first, then as passed.
    let is_met = |passed| required.is_met(passed, report.planned);
    match (is_met(report.passed), is_met(report.passed + open)) {
        (true, _) => Some(true),
        (_, false) => Some(false),
        _ => None,
    }
}

/// Last lines of the summary: the command that flies the worst flight again, and the page if it was written.
fn next_steps(folder: &Path, report: &Report, has_page: bool) -> String {
    let worst = report.worst.first();
    let worst = worst.map(|worst| format!("to fly the worst again, recorded: {}", worst.command));
    let page = has_page.then(|| format!("report: {}", folder.join(PAGE).display()));
    worst.into_iter().chain(page).collect::<Vec<_>>().join("\n")
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

/// Refuses a campaign if flights that are spread over its whole plan are all refused: for example, if no
/// manifest has a varied key. Refuses it also if a text or truth value is refused in each flight, as a
/// misspelt one is.
fn require_flyable(campaign: &Campaign, base: &Base, plan: &Plan) -> Result<()> {
    let all = plan.flights.len();
    if let Some((flight, error)) = refusal(campaign, base, plan, spread(all))? {
        return Err(error).context(format!(
            "no flight can be flown: of the plan's {} {} were checked, which are all refused; flight {flight}",
            flights(all as u64),
            all.min(CHECKED)
        ));
    }
    let mut refusals = Vec::new();
    for (index, varied) in campaign.vary.iter().enumerate() {
        for choice in varied.distribution.choices().unwrap_or_default() {
            let is_chosen =
                |flight: &usize| varied.distribution.choice(plan.flights[*flight][index]) == Some(choice);
            let chosen = (0..all).filter(is_chosen).take(CHECKED_OF_CHOICE);
            if let Some((flight, error)) = refusal(campaign, base, plan, chosen)? {
                let name = &varied.name;
                let about = format!("no flight with {choice} as `{name}` can be flown; flight {flight}");
                refusals.push((error, about));
            }
        }
    }
    require_none(refusals, &campaign.path)
}

/// Returns the `refusals`, each with what it is about, as one error.
fn require_none(mut refusals: Vec<(anyhow::Error, String)>, campaign: &Path) -> Result<()> {
    if refusals.len() == 1 {
        let (error, about) = refusals.remove(0);
        return Err(error.context(about));
    }
    let told = |(error, about): (anyhow::Error, String)| {
        let of_choice = |mut fault: Diagnostic| {
            fault.error = fault.error.of(about.as_str());
            fault
        };
        changed(error, of_choice).context(about)
    };
    together(Some(()), refusals.into_iter().map(told).collect(), campaign)
}

/// The first of these flights with its error, if all of them are refused.
fn refusal(
    campaign: &Campaign,
    base: &Base,
    plan: &Plan,
    flights: impl Iterator<Item = usize>,
) -> Result<Option<(usize, anyhow::Error)>> {
    let mut first = None;
    for flight in flights {
        match base.check(&plan.sets(campaign, base, flight)?) {
            Ok(()) => return Ok(None),
            Err(error) => first = first.or(Some((flight, error))),
        }
    }
    Ok(first)
}

/// Indices below `count`: all of few, in the order of the plan; the first [`CHECKED`] that fill many evenly.
fn spread(count: usize) -> impl Iterator<Item = usize> {
    let index = move |number: usize| {
        if count <= CHECKED { number } else { ((number as f64 * STEP).fract() * count as f64) as usize }
    };
    (0..count.min(CHECKED)).map(index)
}
