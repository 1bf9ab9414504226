//! Trials of every setting, on all cores.

use indicatif::{ProgressBar, ProgressStyle};
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use tanker_pose::simulation::{
    Experiment, Method, PaperBound, Setting, Solver, Summary, paper_bound, trial_generator,
};

use super::error::ReproduceError;

/// Trials between two movements of the progress bar.
const TRIALS_A_TICK: u32 = 100;

/// An experiment and its results.
pub struct Outcome {
    pub experiment: Experiment,
    /// In the order of its settings.
    pub points: Vec<Point>,
}

/// The results of one setting.
pub struct Point {
    pub setting: Setting,
    pub bound: PaperBound,
    /// In the order of the experiment's methods.
    pub summaries: Vec<(Method, Summary)>,
}

/// Returns the outcomes. They do not depend on the number of threads: every trial has a generator of
/// its own, and the sums are taken in the order of the trials.
pub fn run(
    experiments: &[Experiment],
    trials: u32,
    seed: u64,
) -> Result<Vec<Outcome>, ReproduceError> {
    let solver = Solver::default();
    let total: u64 = experiments
        .iter()
        .map(|e| e.settings.len() as u64 * u64::from(trials * e.trials_factor))
        .sum();
    let progress = bar(total);
    let outcomes = experiments
        .iter()
        .map(|experiment| {
            progress.set_message(experiment.name);
            let points = (0_u16..)
                .zip(&experiment.settings)
                .map(|(index, setting)| {
                    let n = trials * experiment.trials_factor;
                    point(&solver, experiment, (index, setting), n, seed, &progress)
                })
                .collect::<Result<_, _>>()?;
            Ok(Outcome {
                experiment: experiment.clone(),
                points,
            })
        })
        .collect();
    progress.finish_and_clear();
    outcomes
}

fn point(
    solver: &Solver,
    experiment: &Experiment,
    (index, setting): (u16, &Setting),
    trials: u32,
    seed: u64,
    progress: &ProgressBar,
) -> Result<Point, ReproduceError> {
    let bound = paper_bound(&setting.scene, setting.sigma_px).ok_or(ReproduceError::NoBound {
        experiment: experiment.name,
        abscissa: setting.abscissa,
    })?;
    let errors: Vec<_> = (0..trials)
        .into_par_iter()
        .map(|trial| {
            if trial % TRIALS_A_TICK == 0 {
                progress.inc(u64::from(TRIALS_A_TICK.min(trials - trial)));
            }
            let mut random = trial_generator(seed, experiment.stream, index, trial);
            solver.trial(
                &setting.scene,
                setting.sigma_px,
                setting.stop,
                experiment.methods,
                &mut random,
            )
        })
        .collect();
    let summaries = (0..)
        .zip(experiment.methods)
        .map(|(column, &method)| {
            let of_method: Vec<_> = errors.iter().map(|methods| methods[column]).collect();
            (method, Summary::new(&of_method))
        })
        .collect();
    Ok(Point {
        setting: setting.clone(),
        bound,
        summaries,
    })
}

fn bar(total: u64) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg:10} {wide_bar} {percent:>3} %  {eta} left");
    // Goes to standard error, and nowhere where that is not a terminal.
    ProgressBar::new(total).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

impl Outcome {
    /// Returns the names of the series, in the order of their first point.
    pub fn series(&self) -> Vec<&str> {
        let mut names: Vec<&str> = self
            .points
            .iter()
            .map(|point| point.setting.series.as_str())
            .collect();
        names.dedup();
        names
    }

    /// Returns the points of one series.
    pub fn points_of<'a>(&'a self, series: &'a str) -> impl Iterator<Item = &'a Point> + Clone {
        self.points
            .iter()
            .filter(move |point| point.setting.series == series)
    }
}

impl Point {
    /// Returns the summary of one method; `None` where the experiment does not run it.
    pub fn of(&self, method: Method) -> Option<&Summary> {
        self.summaries
            .iter()
            .find(|(known, _)| *known == method)
            .map(|(_, summary)| summary)
    }
}
