//! A worker: a process that flies the flights that it is handed, one after the other.
//!
//! It reads one JSON value a line from standard input: first an [`Order`], then a [`Job`] for each flight. It
//! answers each with a line on standard output: a [`Greeting`], then a [`Row`] for each flight. It ends when
//! its input ends, or with its parent.

use crate::base::Base;
use crate::declaration::Campaign;
use crate::row::Row;
use anyhow::{Context, Result, bail};
use report::summary::Summary;
use runtime::registry::Registry;
use rustix::process::{Signal, set_parent_process_death_signal};
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{BufRead, Write};
use std::path::{Path, PathBuf};

/// Campaign that a worker flies for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Order {
    /// Build of hummingbus that the rows are of.
    pub build: String,
    /// Path of the campaign file.
    pub path: PathBuf,
    /// Its text.
    pub text: String,
    /// Digest of all inputs, as the parent read them.
    pub fingerprint: String,
    /// Folder in which each worker has a folder of its own; the parent makes and removes it.
    pub folder: PathBuf,
}

/// A flight to fly.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Job {
    /// Number of the flight.
    pub flight: u64,
    /// Its overrides.
    pub sets: Vec<String>,
}

/// First answer of a worker.
#[derive(Debug, Serialize, Deserialize)]
pub enum Greeting {
    /// It has read what it needs.
    Ready,
    /// It cannot fly; the reason.
    Refused(String),
}

/// Standard output for answers. Whatever a component prints goes to standard error from here on: the parent reads answers only.
///
/// # Errors
/// If the descriptors cannot be duplicated.
pub fn take_output() -> std::io::Result<File> {
    let output = File::from(rustix::io::dup(std::io::stdout())?);
    rustix::stdio::dup2_stdout(std::io::stderr())?;
    Ok(output)
}

/// Flies what `input` hands out, with the components of `registry`, until it ends. `build` names this program.
///
/// # Errors
/// If input or output break, or a line is not what is expected.
pub fn serve(registry: Registry, build: &str, input: impl BufRead, mut output: impl Write) -> Result<()> {
    // A flight that hangs must not outlive the campaign.
    set_parent_process_death_signal(Some(Signal::KILL)).context("cannot bind the worker to its parent")?;
    let mut lines = input.lines();
    let order = lines.next().context("expected the order, found nothing")??;
    let order: Order = serde_json::from_str(&order)?;
    let folder = tempfile::tempdir_in(&order.folder);
    let folder = folder.with_context(|| format!("cannot make a folder in {}", order.folder.display()))?;
    let (campaign, base) = match prepare(&order, build, registry) {
        Ok(read) => read,
        Err(error) => return answer(&mut output, &Greeting::Refused(format!("{error:#}"))),
    };
    answer(&mut output, &Greeting::Ready)?;
    for line in lines {
        let job: Job = serde_json::from_str(&line?)?;
        answer(&mut output, &fly(&campaign, &base, &job, folder.path()))?;
    }
    Ok(())
}

fn answer(output: &mut impl Write, value: &impl Serialize) -> Result<()> {
    writeln!(output, "{}", serde_json::to_string(value)?)?;
    Ok(output.flush()?)
}

/// The campaign and its manifest. All paths begin at the root, so that those of a row's error do not depend on the working directory.
fn prepare(order: &Order, build: &str, registry: Registry) -> Result<(Campaign, Base)> {
    if order.build != build {
        bail!(
            "this is hummingbus {build}, the campaign was started by hummingbus {}: rows of two builds are not mixed; install \
             the same build here and there",
            order.build
        );
    }
    let path = std::path::absolute(&order.path).context("the working directory is gone")?;
    let campaign = Campaign::parse(&inputs::tidy(&path), &order.text)?;
    let base = Base::read(&campaign, registry)?;
    if base.fingerprint != order.fingerprint {
        bail!("the manifest or a file that it names changed while the campaign flew; start it again");
    }
    Ok((campaign, base))
}

/// The row of one flight; an error is in the row, with paths that begin at the folder of the campaign file.
fn fly(campaign: &Campaign, base: &Base, job: &Job, folder: &Path) -> Row {
    let home = campaign.path.parent().unwrap_or(Path::new(""));
    let broken = |error| Row::broken(job.flight, from_folder(&format!("{error:#}"), home));
    fly_once(base, job, folder).unwrap_or_else(broken)
}

/// `text` with paths that begin at `folder` in place of those that begin at the root. Paths outside of the folders around it stay.
fn from_folder(text: &str, folder: &Path) -> String {
    let mut text = text.to_owned();
    for (up, around) in folder.ancestors().enumerate() {
        let depth = around.components().count() - 1;
        // A folder right below the root may be called like the process of a topic.
        if depth == 0 || (depth == 1 && up > 0) {
            break;
        }
        text = replaced(&text, &format!("{}/", around.display()), &"../".repeat(up));
    }
    text
}

/// `text` with `new` in place of each `old` at the beginning of a path.
fn replaced(text: &str, old: &str, new: &str) -> String {
    let mut parts = text.split(old);
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |all, part| {
        let is_within = all.ends_with(|c: char| c.is_alphanumeric() || "._-~/".contains(c));
        all + if is_within { old } else { new } + part
    })
}

fn fly_once(base: &Base, job: &Job, folder: &Path) -> Result<Row> {
    let manifest = base.of_flight(&job.sets)?;
    let mut outcome = runtime::fly_unrecorded(&manifest, base.files.branch(), folder, base.from.as_ref())?;
    let figures = outcome.figures.take().context("the judge left no figures")?;
    let tick_s = 1.0 / f64::from(*manifest.content.run.rate_hz.get_ref());
    let mut summary = Summary::new(manifest.name(), outcome, tick_s);
    summary.judge_by(&figures, &manifest.content)?;
    Ok(Row::of(job.flight, &summary, &manifest.content))
}

#[cfg(test)]
mod tests {
    use super::{Job, fly, from_folder};
    use crate::base::Base;
    use crate::declaration::Campaign;
    use crate::plan::Plan;
    use crate::report::Report;
    use bus::component::{Component, Info, StepError};
    use bus::context::{NodeContext, StepContext};
    use bus::messages::MotorCommand;
    use bus::{ParameterError, Registration};
    use runtime::registry::Registry;
    use std::collections::BTreeMap;

    #[derive(bus::OutputPorts)]
    struct Outputs {
        command: MotorCommand,
    }

    /// Commands of a spring, which breaks at a load above 1.
    struct Spring {
        load: f64,
    }

    impl Component for Spring {
        const INFO: Info = Info::new("spring", "sends its load");
        type Parameters = BTreeMap<String, f64>;
        type Inputs<'a> = ();
        type Outputs = Outputs;
        type State = ();
        fn new(parameters: Self::Parameters, _: &NodeContext<'_>) -> Result<Self, ParameterError> {
            Ok(Self { load: parameters["load"] })
        }
        fn initial(&self) {}
        fn step(&self, context: &StepContext<'_>, (): (), (): &mut ()) -> Result<Outputs, StepError> {
            assert!(context.tick() < 5 || self.load <= 1.0, "the spring broke under {}", self.load);
            Ok(Outputs { command: MotorCommand { command: [self.load; 4].into(), ..Default::default() } })
        }
    }

    const COMPONENTS: Registry =
        Registry::new(&[Registration::of::<Spring>(), Registration::of::<report::judge::node::Judge>()]);

    #[test]
    fn a_flight_whose_component_panics_is_named_and_counted_and_the_rest_flies() {
        let folder = tempfile::tempdir().unwrap();
        let manifest = "[run]\nduration_s = 0.1\n[process.spring]\nkind = \"spring\"\nparameters.load = 0.0\n\
                        [[measure]]\nname = \"command\"\ntopic = \"/spring/command\"\nfield = \"command[0]\"\nunit = \"count\"\nstatistic = \"last\"\n";
        std::fs::write(folder.path().join("m.toml"), manifest).unwrap();
        let text = "manifest = \"m.toml\"\nsampling = \"grid\"\n[[vary]]\nkey = \"process.spring.parameters.load\"\nvalues = [0.5, 2.5, 1.0]";
        let campaign = Campaign::parse(&folder.path().join("c.toml"), text).unwrap();
        let base = Base::read(&campaign, COMPONENTS).unwrap();
        let plan = Plan::of(&campaign);
        let row = |flight: usize| {
            let sets = plan.sets(&campaign, &base, flight).unwrap();
            fly(&campaign, &base, &Job { flight: flight as u64, sets }, folder.path())
        };
        let rows: Vec<_> = (0..3).map(row).collect();
        let loads: Vec<_> = rows.iter().map(|row| row.figures.first().copied().flatten()).collect();
        assert_eq!(loads, [Some(0.5), None, Some(1.0)]);
        let error = rows[1].error.as_deref().unwrap();
        assert_eq!(error, "a component panicked: the spring broke under 2.5");
        assert!(!rows[1].is_of_host);
        let report = Report::of(&campaign, &base, &plan, &rows, folder.path(), "1").unwrap();
        assert_eq!((report.passed, report.broken, report.lost), (2, 1, 0));
        assert!(
            report.to_string().contains("1 flight without figures:\n    flight 1: a component panicked"),
            "{report}"
        );
    }

    #[test]
    fn paths_begin_at_the_folder_of_the_campaign_file() {
        let shown = |text: &str| from_folder(text, "/home/me/drone/campaigns".as_ref());
        assert_eq!(shown("/home/me/drone/campaigns/c.toml:6:7: no"), "c.toml:6:7: no");
        assert_eq!(
            shown("process `a`: /home/me/drone/hover.toml:1:2: look at `/home/me/other/v.toml:3`"),
            "process `a`: ../hover.toml:1:2: look at `../../other/v.toml:3`"
        );
        // Others are no folders around it.
        for text in ["/opt/v.toml:1:2", "../home/me/v.toml", "/home/you/v.toml", "topic /home/state"] {
            assert_eq!(shown(text), text);
        }
        assert_eq!(from_folder("/sim/c.toml:1:1, /sim/a/b.toml", "/sim".as_ref()), "c.toml:1:1, a/b.toml");
    }
}
