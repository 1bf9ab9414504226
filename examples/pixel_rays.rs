//! Turns pixels into rays and back with the node's lens models: one JSON line in, one out.
//!
//! ```sh
//! echo '{"width": 640, "height": 480, "model": "plumb_bob", "d": [-0.3, 0.1, 0, 0, 0],
//!        "k": [440, 0, 320, 0, 440, 240, 0, 0, 1], "pixels": [[0, 0], [320, 240]]}' | tr -d '\n' |
//!   cargo run --example pixel_rays
//! ```
//!
//! The answer has `rays`, points on the plane z = 1, and `pixels`, what the rays project to; both are null for a pixel
//! outside the lens model's valid region.

use std::io::{self, BufRead, Write};

use serde::{Deserialize, Serialize};
use tanker_pose::camera::{Camera, CameraInfo, Pixel};

#[derive(Deserialize)]
struct Request {
    width: u32,
    height: u32,
    model: String,
    d: Vec<f64>,
    k: [f64; 9],
    pixels: Vec<[f64; 2]>,
}

#[derive(Serialize)]
struct Answer {
    rays: Vec<Option<[f64; 2]>>,
    pixels: Vec<Option<[f64; 2]>>,
}

fn answer(line: &str) -> Result<Answer, Box<dyn std::error::Error>> {
    let request: Request = serde_json::from_str(line)?;
    let info = CameraInfo {
        width: request.width,
        height: request.height,
        distortion_model: request.model,
        d: request.d,
        k: request.k,
        ..CameraInfo::default()
    };
    let camera = Camera::from_info(&info, false)?;
    let rays: Vec<_> = request
        .pixels
        .iter()
        .map(|&[u, v]| camera.ray_from_pixel(Pixel { u, v }).ok())
        .collect();
    let back = rays.iter().map(|&ray| Some(camera.project(ray?)?.0));
    Ok(Answer {
        pixels: back
            .map(|pixel| pixel.map(|pixel| [pixel.u, pixel.v]))
            .collect(),
        rays: rays
            .iter()
            .map(|ray| ray.map(|ray| [ray.x, ray.y]))
            .collect(),
    })
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut output = io::stdout().lock();
    for line in io::stdin().lock().lines() {
        serde_json::to_writer(&mut output, &answer(&line?)?)?;
        writeln!(output)?;
    }
    Ok(())
}
