//! The command `campaign`: thousands of flights of one manifest, each with other values.

use super::interrupts::stop_token;
use super::output::{print_json, print_text, say};
use super::progress;
use anyhow::{Context, Result, bail};
use campaign::base::Base;
use campaign::declaration::Campaign;
use campaign::plan::Plan;
use campaign::pool::Pool;
use campaign::report::Report;
use campaign::requirement::Requirement;
use campaign::row::{Row, columns};
use campaign::store::Store;
use campaign::worker::{Job, Order, serve};
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
use std::io::{stdin, stdout};
use std::path::{Path, PathBuf};
use std::time::Duration;

pub const HELP: &str = "Example: hummingbus campaign manifests/campaigns/hover-robustness.toml --out robustness\n\n\
                        Writes plan.csv, flights.parquet, report.json and report.html into the folder. The same command goes \
                        on where an earlier one was interrupted. docs/campaigns.md has the keys of campaign files.";

/// Progress of a campaign.
const BAR: &str = "{bar:30} {pos}/{len} flights  {per_sec}, {eta} left  {msg}";
/// Flights that are checked before the first one is flown.
const CHECKED: usize = 3;
/// The hidden argument of a worker.
const WORKER: &str = "--worker";

/// What `campaign` takes.
#[derive(Args)]
pub struct CampaignArguments {
    /// The campaign file.
    #[arg(required_unless_present = "worker")]
    campaign: Option<PathBuf>,
    /// Folder for the plan, the flights and the report; named like the campaign file where absent.
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    /// Number of worker processes; one for each core where absent.
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u16).range(1..=1024))]
    workers: Option<u16>,
    /// Draw and write the plan, and fly nothing.
    #[arg(long)]
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
}

/// The command `campaign`; false if the requirement is not met.
///
/// # Errors
/// A problem in the campaign, its manifest or its folder, or an interrupted campaign.
pub fn campaign(arguments: &CampaignArguments) -> Result<bool> {
    if arguments.worker {
        return serve(COMPONENTS, stdin().lock(), stdout().lock()).map(|()| true);
    }
    let path = arguments.campaign.as_deref().context("expected a campaign file")?;
    let text = InputFiles::default().text(path).with_context(|| format!("cannot read {}", path.display()))?;
    let campaign = Campaign::parse(path, &text)?;
    let base = Base::read(&campaign, COMPONENTS)?;
    let figures = columns(&base.manifest.content);
    let folder = arguments.out.clone().unwrap_or_else(|| path.with_extension(""));
    let (mut store, plan, flown) = Store::open(&folder, &campaign, &base.fingerprint, &figures)?;
    if arguments.plan_only {
        print_text(&format!(
            "{} flights: {}",
            plan.flights.len(),
            folder.join(campaign::store::PLAN).display()
        ))?;
        return Ok(true);
    }
    if let Some(flight) = arguments.fly {
        return fly_one(&campaign, &base, &plan, flight, &folder, arguments.json);
    }
    let mut rows = flown;
    let stop = stop_token()?;
    let jobs = jobs(&campaign, &base, &plan, &rows)?;
    require_flyable(&base, &jobs)?;
    let bar = progress::bar(BAR, arguments.json);
    bar.set_length(plan.flights.len() as u64);
    bar.set_position(rows.len() as u64);
    let pool = Pool {
        command: &worker_command()?,
        workers: workers(arguments, jobs.len()),
        order: &Order {
            path: path.to_owned(),
            text,
            fingerprint: base.fingerprint.clone(),
            folder: store.make_work_folder()?,
        },
        timeout: Duration::from_secs_f64(campaign.timeout_s_host),
    };
    let end = pool.fly(jobs.into_iter(), &stop, |mut row| {
        row.drawn.clone_from(&plan.flights[row.flight as usize]);
        row.figures.resize(figures.len(), None);
        store.add(&row)?;
        rows.insert(row.flight, row);
        bar.inc(1);
        Ok(())
    });
    progress::finish(&bar);
    store.remove_work_folder()?;
    let rows: Vec<Row> = rows.into_values().collect();
    table::write(&folder.join("flights.parquet"), &plan, &figures, &rows)?;
    end.with_context(|| format!("{} flights are in {}", rows.len(), folder.display()))?;
    let report = Report::of(&campaign, &base, &plan, &rows)?;
    std::fs::write(folder.join("report.json"), serde_json::to_vec_pretty(&report)?)?;
    std::fs::write(folder.join("report.html"), page::page(&report, &plan, &figures, &rows))?;
    let is_met = arguments.require.is_none_or(|required| required.is_met(report.passed, report.flights));
    if arguments.json {
        let mut value = json!(report);
        value["requirement_met"] = json!(is_met);
        print_json(&value)?;
    } else {
        print_text(&format!("{report}{}", next_steps(path, &folder, &report)))?;
    }
    if report.flights < report.planned {
        bail!(
            "the campaign was interrupted; the same command flies the other {} flights",
            report.planned - report.flights
        );
    }
    if let Some(required) = arguments.require.filter(|_| !is_met) {
        let shown = required.shown(report.passed, report.flights);
        say(&format!("not met: {required}; these flights show {shown:.4}"));
    }
    Ok(is_met)
}

/// Last lines of the summary: the page, and the command that flies the worst flight again.
fn next_steps(campaign: &Path, folder: &Path, report: &Report) -> String {
    let page = format!("to see it: {}", folder.join("report.html").display());
    let Some(worst) = report.worst.first() else { return page };
    let again = format!("{} --out {} --fly {}", campaign.display(), folder.display(), worst.flight);
    format!("to fly the worst again, recorded: hummingbus campaign {again}\n{page}")
}

/// Flies flight number `flight` of the plan on this thread, recorded; false if a condition does not hold.
fn fly_one(
    campaign: &Campaign,
    base: &Base,
    plan: &Plan,
    flight: usize,
    folder: &Path,
    is_json: bool,
) -> Result<bool> {
    if flight >= plan.flights.len() {
        bail!("there is no flight {flight}: the plan has the flights 0 to {}", plan.flights.len() - 1);
    }
    let recording = std::path::absolute(folder.join(format!("flight-{flight}.mcap")))?;
    let record = toml::Value::from(recording.to_string_lossy().into_owned());
    let sets = [plan.sets(campaign, base, flight)?, vec![format!("run.record={record}")]].concat();
    let manifest = base.of_flight(&sets)?;
    let graph = Graph::build_from(&manifest, base.files.branch())?;
    let launcher = Launcher::new(Host::InProcess).stopped_by(&stop_token()?).reading(base.files.branch());
    let (outcome, flown) = launcher.fly(&manifest, &recording)?;
    let mut summary =
        Summary::new(format!("{} flight {flight}", manifest.name()), outcome, graph.plan.tick_s());
    let flown = flown.context("the manifest has no recorder: add one to see a flight")?;
    summary.judge(&flown, &graph.plan, &manifest.content)?;
    if is_json {
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

fn workers(arguments: &CampaignArguments, jobs: usize) -> usize {
    let cores = || std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    arguments.workers.map_or_else(cores, usize::from).min(jobs)
}

/// The command that starts a worker.
fn worker_command() -> Result<Vec<String>> {
    let program = std::env::current_exe().context("cannot find this program")?;
    let program = program.to_str().context("the path of this program is not UTF-8")?.to_owned();
    Ok(vec![program, "campaign".to_owned(), WORKER.to_owned()])
}
