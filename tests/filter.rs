//! scratch
use nalgebra::{Isometry3, Vector3, Vector6};
use tanker_pose::estimation::{Estimator, EstimatorSettings, Initialisation, Observation, Refinement};
use tanker_pose::camera::Pixel;
use tanker_pose::geometry::*;
use tanker_pose::pipeline;
use tanker_pose::simulation::*;
use tanker_pose::target::MarkerMap;
use tanker_pose::tracking::*;

#[test]
fn scratch() {
    let acc: f64 = std::env::var("ACC").map_or(0.2, |s| s.parse().unwrap());
    let ang: f64 = std::env::var("ANG").map_or(4.0, |s| s.parse().unwrap());
    let amb: f64 = std::env::var("AMB").map_or(0.1, |s| s.parse().unwrap());
    let map = MarkerMap::shipped("paper").unwrap();
    for seed in 1..=6 {
        let approach = Approach::new(ApproachSettings { start_range_m: 60.0, end_range_m: 12.0, duration_s: 50.0, rate_hz: 30.0, sigma_px: 1.0, attitude_deg: 3.0, seed }, paper_camera(), map.clone());
        let estimator = Estimator::new(EstimatorSettings { initialisation: Initialisation::Previous, refinement: Refinement::MaximumLikelihood, min_points: 5, max_outliers: 1, max_ambiguity: amb, ..Default::default() });
        let mut filter = Filter::new(FilterSettings { acceleration_density_mps2: acc, angular_acceleration_density_dps2: ang, ..Default::default() }).unwrap();
        let camera = paper_camera();
        let (mut single, mut filtered, mut vel, mut rate) = (Vector6::zeros(), Vector6::zeros(), Vector3::zeros(), Vector3::zeros());
        let (mut n, mut refused, mut gated, mut nees, mut nees_p, mut ns, mut nis) = (0, 0, 0, 0.0, 0.0, 0, 0.0);
        let mut snees = 0.0;
        for k in 1..approach.frame_count() - 1 {
            let frame = approach.frame(k);
            let stamp = 1_000_000_000_000 + i64::from(k) * 33_333_333;
            let obs: Vec<Observation> = frame.detections.iter().map(|d| Observation { id: d.id, marker_in_tanker: map.get(d.id).unwrap(), pixel: Pixel { u: d.u_px, v: d.v_px }, sigma_px: d.sigma_px }).collect();
            let prior = filter.predict(stamp).ok().map(|m| m.b_from_a.rotation.to_rotation_matrix());
            let outcome = pipeline::solve(&estimator, &camera, &obs, prior.as_ref());
            let truth = frame.truth_camera_from_tanker;
            match outcome.result {
                Err(_r) => { refused += 1; filter.miss(stamp); }
                Ok(s) => {
                    let e = pose_error(&truth, &s.camera_from_tanker);
                    snees += s.covariance.mahalanobis_squared(&e).unwrap();
                    ns += 1;
                    match filter.update(stamp, &s.camera_from_tanker, &s.covariance) {
                        TrackOutcome::Gated { .. } => gated += 1,
                        TrackOutcome::Updated { innovation_squared } => {
                            nis += innovation_squared;
                            let m = filter.track().unwrap().motion;
                            let (a, b) = (approach.frame(k - 1).truth_camera_from_tanker, approach.frame(k + 1).truth_camera_from_tanker);
                            let dt2 = 2.0 / 30.0;
                            let tm = Motion { b_from_a: truth, velocity_in_b: (b.translation.vector - a.translation.vector) / dt2, rate_in_b: (b.rotation * a.rotation.inverse()).scaled_axis() / dt2, covariance: m.covariance };
                            let err = motion_error(&tm, &m);
                            nees += m.mahalanobis_squared(&err).unwrap();
                            nees_p += m.pose_covariance().mahalanobis_squared(&err.fixed_rows::<6>(0).into_owned()).unwrap();
                            let f = err.fixed_rows::<6>(0).into_owned();
                            single += e.component_mul(&e); filtered += f.component_mul(&f);
                            let v = err.fixed_rows::<3>(6).into_owned(); vel += v.component_mul(&v);
                            let v = err.fixed_rows::<3>(9).into_owned(); rate += v.component_mul(&v);
                            n += 1;
                        }
                        _ => {}
                    }
                }
            }
        }
        let nf = n as f64;
        let ratio = single.zip_map(&filtered, |a: f64, b: f64| (a / b).sqrt());
        let att = ((single[3] + single[4] + single[5]) / (filtered[3] + filtered[4] + filtered[5]) as f64).sqrt();
        println!("seed {seed}: n {n} refused {refused} gated {gated} ratio xyz {:.2} {:.2} {:.2} att {:.2} ({:.2} {:.2} {:.2}) vel {:.3?} rate {:.2?} nees12 {:.2} nees6 {:.2} single {:.2} nis {:.2}; single rms {:.3?}", ratio[0], ratio[1], ratio[2], att, ratio[3], ratio[4], ratio[5], (vel / nf).map(f64::sqrt).as_slice(), (rate / nf).map(|x: f64| x.sqrt().to_degrees()).as_slice(), nees / nf, nees_p / nf, snees / ns as f64, nis / nf, (single / nf).map(f64::sqrt).as_slice());
    }
    let _ = Isometry3::<f64>::identity();
}
