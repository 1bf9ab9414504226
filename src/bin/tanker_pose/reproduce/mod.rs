//! `tanker_pose reproduce`: the experiments of the paper's section 4, and worlds that depart from what is believed, as
//! tables and plots.
//!
//! The settings are the library's ([`Experiment`]); here are threads, files and pictures.

mod departures;
mod error;
mod figure;
mod monte_carlo;
mod report;
mod run;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::ValueEnum;
use tanker_pose::simulation::Experiment;

pub use error::ReproduceError;

use crate::plot::panel;

/// Images of the single approach drawn beside Fig. 8.
const RUN_IMAGES_A_SECOND: f64 = 2.0;

#[derive(Debug, clap::Args)]
#[command(allow_negative_numbers = true)]
pub struct Arguments {
    /// What to reproduce
    #[arg(value_enum, default_value_t = What::All)]
    what: What,
    /// Directory for tables (CSV) and plots (SVG); made where missing
    #[arg(long, value_name = "DIR", default_value = "reproduction")]
    out: PathBuf,
    /// Noisy images for each point of a plot; ten times as many for the shares of wrong minima
    #[arg(long, value_name = "N", default_value_t = 4000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    trials: u32,
    /// Seed of the noise: the same seed gives the same files, whatever the number of threads
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Print JSON instead of tables
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum What {
    /// Error and number of points
    Fig5,
    /// Error and separation of the points
    Fig7,
    /// The methods along the route
    Fig8,
    /// Levels of noise along the route
    Fig9,
    /// Failures and wrong minima
    Minima,
    /// Steps of the iteration to a tolerance
    Iterations,
    /// The iteration stopped after few steps
    Stopped,
    /// Worlds that differ from map, calibration and sigma, with the error budget and without; not the paper's, and not part
    /// of `all`
    Departures,
    /// Everything of the paper
    All,
}

pub fn run(arguments: &Arguments) -> Result<(), ReproduceError> {
    let begin = Instant::now();
    std::fs::create_dir_all(&arguments.out).map_err(|source| ReproduceError::Directory {
        path: arguments.out.clone(),
        source,
    })?;
    if arguments.what == What::Departures {
        return run_departures(arguments, begin);
    }
    let wanted = arguments.what.experiments();
    let outcomes = monte_carlo::run(&wanted, arguments.trials, arguments.seed)?;
    let mut files = Vec::new();
    for outcome in &outcomes {
        files.push(write(
            &arguments.out,
            &format!("{}.csv", outcome.experiment.name),
            &report::csv(outcome),
        )?);
        if let Some(figure) = figure::of(outcome) {
            files.push(draw(&arguments.out, outcome.experiment.name, &figure)?);
        }
        if outcome.experiment.name == "fig8" {
            let approach = run::Run::new(arguments.seed, RUN_IMAGES_A_SECOND);
            files.push(write(&arguments.out, "fig8_run.csv", &approach.csv())?);
            files.push(draw(&arguments.out, "fig8_run", &approach.figure())?);
        }
    }
    let texts = outcomes.iter().map(report::text);
    let json = || report::json(&outcomes, &files, arguments.seed);
    print(arguments, texts, json, &files, begin)
}

fn run_departures(arguments: &Arguments, begin: Instant) -> Result<(), ReproduceError> {
    let Arguments {
        out, trials, seed, ..
    } = arguments;
    let points = departures::run(*trials, *seed);
    let mut files = vec![write(out, "departures.csv", &departures::csv(&points))?];
    for (name, figure) in departures::figures(&points, *trials) {
        files.push(draw(out, name, &figure)?);
    }
    let text = departures::text(&points, *trials);
    let json = || departures::json(&points, &files, *seed);
    print(arguments, [text].into_iter(), json, &files, begin)
}

fn print(
    arguments: &Arguments,
    texts: impl Iterator<Item = String>,
    json: impl FnOnce() -> serde_json::Value,
    files: &[PathBuf],
    begin: Instant,
) -> Result<(), ReproduceError> {
    let mut stdout = std::io::stdout().lock();
    let print = move || {
        if arguments.json {
            return writeln!(stdout, "{:#}", json());
        }
        for text in texts {
            writeln!(stdout, "{text}")?;
        }
        let seconds = begin.elapsed().as_secs_f64();
        writeln!(stdout, "{seconds:.0} s, files:")?;
        for file in files {
            writeln!(stdout, "  {}", file.display())?;
        }
        Ok(())
    };
    match print() {
        // The reader has seen enough, as `head` does: not a fault.
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        result => result.map_err(ReproduceError::Print),
    }
}

fn write(directory: &Path, name: &str, text: &str) -> Result<PathBuf, ReproduceError> {
    let path = directory.join(name);
    match std::fs::write(&path, text) {
        Ok(()) => Ok(path),
        Err(source) => Err(ReproduceError::File { path, source }),
    }
}

fn draw(directory: &Path, name: &str, figure: &panel::Figure) -> Result<PathBuf, ReproduceError> {
    let path = directory.join(format!("{name}.svg"));
    let svg = panel::svg(figure).map_err(|error| ReproduceError::Plot {
        path: path.clone(),
        reason: error.to_string(),
    })?;
    write(directory, &format!("{name}.svg"), &svg)
}

impl What {
    fn experiments(self) -> Vec<Experiment> {
        match self {
            Self::Fig5 => vec![Experiment::number_of_points()],
            Self::Fig7 => vec![Experiment::separation()],
            Self::Fig8 => vec![Experiment::methods()],
            Self::Fig9 => vec![Experiment::noise()],
            Self::Minima => vec![Experiment::minima()],
            Self::Iterations => vec![Experiment::iterations()],
            Self::Stopped => vec![Experiment::stopped()],
            Self::Departures => Vec::new(),
            Self::All => Experiment::all(),
        }
    }
}
