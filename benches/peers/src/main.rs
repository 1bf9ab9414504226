//! Worker of the peers benchmark: ours and the crate `sqpnp`, driven over a pipe.
//!
//! `peers frames FILE` writes the frames for the workers in other languages; `peers ours` and `peers others` answer
//! lines for our methods and for the rest, which are built with the profile that suits each best:
//! `methods`, `time METHOD SIZE_INDEX` (ns per solve), `poses METHOD SIZE_INDEX` (one pose a line).

mod frames;

use std::hint::black_box;
use std::io::BufRead;
use std::path::Path;

use frames::{Frame, numbers};
use glam::{Vec2, Vec3};
use nalgebra::Isometry3;
use rustix::time::{ClockId, clock_gettime};
use tanker_pose::camera::Camera;
use tanker_pose::estimation::{
    Estimator, EstimatorSettings, Initialisation, Refinement, iterate_literally,
};
use tanker_pose::geometry::optical_from_body;
use tanker_pose::simulation::paper_camera;

/// CPU time; a block is repeated until it lasts at least this long.
const BLOCK_S: f64 = 4e-3;

type Solve = Box<dyn FnMut(usize, usize) -> Option<Isometry3<f64>>>;

fn main() {
    let all: &'static [Vec<Frame>] = Box::leak(frames::all().into_boxed_slice());
    let arguments: Vec<String> = std::env::args().collect();
    if let [_, command, path] = &arguments[..]
        && command == "frames"
    {
        frames::write(all, Path::new(path)).expect("the frames can be written");
        return;
    }
    let camera: &'static Camera = Box::leak(Box::new(paper_camera()));
    let is_ours = match arguments.get(1).map(String::as_str) {
        Some("ours") => true,
        Some("others") => false,
        _ => panic!("expected ours, others or frames FILE"),
    };
    let mut methods = methods(all, camera);
    methods.retain(|(name, _)| name.starts_with("ours_") == is_ours);
    for line in std::io::stdin().lock().lines() {
        let line = line.expect("the driver writes text");
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            ["methods"] => {
                let names: Vec<_> = methods.iter().map(|(name, _)| *name).collect();
                println!("{}", names.join(" "));
            }
            ["time", name, size] => {
                let size: usize = size.parse().expect("an index");
                println!(
                    "{}",
                    ns_per_solve(find(&mut methods, name), size, all[size].len())
                );
            }
            ["poses", name, size] => {
                let size: usize = size.parse().expect("an index");
                for index in 0..all[size].len() {
                    let pose = find(&mut methods, name)(size, index);
                    println!("{}", pose.map_or("none".into(), |pose| row(&pose)));
                }
            }
            _ => panic!("what does {line:?} mean?"),
        }
    }
}

fn find<'a>(methods: &'a mut [(&'static str, Solve)], name: &str) -> &'a mut Solve {
    let found = methods.iter_mut().find(|(known, _)| *known == name);
    &mut found.expect("a method that was listed").1
}

fn row(pose: &Isometry3<f64>) -> String {
    numbers(pose).map(|x| format!("{x:e}")).join(" ")
}

fn ns_per_solve(solve: &mut Solve, size: usize, frames: usize) -> f64 {
    let mut pass = || {
        for index in 0..frames {
            black_box(solve(black_box(size), black_box(index)));
        }
    };
    pass();
    let (begin_s, mut passes) = (cpu_time_s(), 0);
    while cpu_time_s() - begin_s < BLOCK_S {
        pass();
        passes += 1;
    }
    (cpu_time_s() - begin_s) * 1e9 / f64::from(passes) / frames as f64
}

/// CPU time of this thread: what others do on the machine at the same time is not the method's.
fn cpu_time_s() -> f64 {
    let now = clock_gettime(ClockId::ThreadCPUTime);
    now.tv_sec as f64 + 1e-9 * now.tv_nsec as f64
}

fn methods(all: &'static [Vec<Frame>], camera: &'static Camera) -> Vec<(&'static str, Solve)> {
    let ours = |initialisation, refinement| -> Solve {
        let estimator = Estimator::new(EstimatorSettings {
            initialisation,
            refinement,
            // Others answer every frame, and leave nothing out.
            min_points: 3,
            max_outliers: 0,
            ..Default::default()
        });
        Box::new(move |size, index| {
            let frame = &all[size][index];
            let solution = estimator.estimate(camera, &frame.observations, None).ok()?;
            Some(black_box(solution).camera_from_tanker)
        })
    };
    vec![
        (
            "ours_prior_ml",
            ours(Initialisation::Nominal, Refinement::MaximumLikelihood),
        ),
        (
            "ours_prior_oi",
            ours(Initialisation::Nominal, Refinement::None),
        ),
        (
            "ours_global_ml",
            ours(Initialisation::Global, Refinement::MaximumLikelihood),
        ),
        (
            "ours_global_oi",
            ours(Initialisation::Global, Refinement::None),
        ),
        ("ours_literal_oi", literal(all, camera)),
        ("crate_sqpnp", crate_sqpnp(all)),
    ]
}

/// The paper's iteration as it is written, until a step turns less than 1e-6 rad.
fn literal(all: &'static [Vec<Frame>], camera: &'static Camera) -> Solve {
    Box::new(move |size, index| {
        let frame = &all[size][index];
        let rays = frames::rays(camera, &frame.observations);
        let seed = optical_from_body();
        let found = iterate_literally(&rays, &frame.markers_in_tanker, &seed, 1e-6, 1000).ok()?;
        Some(found.camera_from_tanker)
    })
}

/// Its rays are made beforehand, in its own types: only the solver's time counts.
fn crate_sqpnp(all: &'static [Vec<Frame>]) -> Solve {
    let inputs: Vec<Vec<(Vec<Vec3>, Vec<Vec2>)>> = all
        .iter()
        .map(|frames| frames.iter().map(single_precision).collect())
        .collect();
    let mut solver = sqpnp::Solver::<sqpnp::DefaultParameters>::new();
    Box::new(move |size, index| {
        let (points, rays) = &inputs[size][index];
        if !solver.solve(points, rays, None) {
            return None;
        }
        let best = solver.best_solution()?;
        let (r, t) = (best.rotation_matrix(), best.translation());
        let rotation =
            nalgebra::Rotation3::from_matrix_unchecked(nalgebra::Matrix3::from_fn(|i, j| {
                f64::from(r.col(j)[i])
            }));
        Some(Isometry3::from_parts(
            nalgebra::Translation3::new(f64::from(t.x), f64::from(t.y), f64::from(t.z)),
            nalgebra::UnitQuaternion::from_rotation_matrix(&rotation),
        ))
    })
}

#[allow(clippy::cast_possible_truncation)] // its interface
fn single_precision(frame: &Frame) -> (Vec<Vec3>, Vec<Vec2>) {
    let points = frame.markers_in_tanker.iter();
    let points = points.map(|p| Vec3::new(p.x as f32, p.y as f32, p.z as f32));
    let rays = frame.rays.iter().map(|v| Vec2::new(v.x as f32, v.y as f32));
    (points.collect(), rays.collect())
}
