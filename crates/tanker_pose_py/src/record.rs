//! An outcome as the bytes of one element of a structured array.
//!
//! Bytes, because numpy's elements of Rust types would need unsafe code, and because threads can fill parts of one buffer.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use tanker_pose::estimation::{Certificate, Observation, Solution};
use tanker_pose::messages::EstimatorStatus;
use tanker_pose::pipeline::OutcomeCode;

/// Name, numpy's format, size of one number in bytes, and shape of each field, in the order of [`write`]. The last one,
/// `used`, has one truth value a point.
const FIELDS: [(&str, &str, usize, &[usize]); 12] = [
    ("rotation", "f8", 8, &[3, 3]),
    ("translation", "f8", 8, &[3]),
    ("covariance", "f8", 8, &[6, 6]),
    ("rms_px", "f8", 8, &[]),
    ("chi_squared", "f8", 8, &[]),
    ("chi_squared_limit", "f8", 8, &[]),
    ("ambiguity", "f8", 8, &[]),
    ("degrees_of_freedom", "u2", 2, &[]),
    ("iterations", "u2", 2, &[]),
    ("outcome", "u1", 1, &[]),
    ("certificate", "u1", 1, &[]),
    ("used", "?", 1, &[]),
];

/// Bytes before `used`.
fn fixed_size() -> usize {
    let sizes = FIELDS
        .iter()
        .map(|(_, _, size, shape)| size * shape.iter().product::<usize>());
    sizes.sum::<usize>() - 1
}

/// Returns the bytes of a record: whole numbers of eight, so that doubles stay aligned.
pub fn size(points: usize) -> usize {
    (fixed_size() + points).next_multiple_of(8)
}

/// Returns numpy's description of a record.
pub fn dtype(py: Python<'_>, points: usize) -> PyResult<Bound<'_, PyAny>> {
    let mut names = Vec::new();
    let mut formats = Vec::new();
    let mut offsets = Vec::new();
    let mut offset = 0;
    for (name, format, size, shape) in FIELDS {
        let shape = if name == "used" {
            vec![points]
        } else {
            shape.to_vec()
        };
        names.push(name);
        offsets.push(offset);
        offset += size * shape.iter().product::<usize>();
        let shape = pyo3::types::PyTuple::new(py, shape)?;
        formats.push((format, shape));
    }
    let description = PyDict::new(py);
    description.set_item("names", names)?;
    description.set_item("formats", formats)?;
    description.set_item("offsets", offsets)?;
    description.set_item("itemsize", size(points))?;
    numpy::get_array_module(py)?.call_method1("dtype", (description,))
}

/// Returns the nine numbers of the rotation row by row, and the translation.
pub fn pose(solution: &Solution) -> ([f64; 9], [f64; 3]) {
    let pose = &solution.camera_from_tanker;
    let rotation = pose.rotation.to_rotation_matrix();
    let rotation = std::array::from_fn(|i| rotation[(i / 3, i % 3)]);
    (rotation, pose.translation.vector.into())
}

/// Returns the number of a certificate, as the node's status has it.
fn certificate(solution: &Solution) -> u8 {
    match solution.certificate {
        None => EstimatorStatus::CERTIFICATE_NONE,
        Some(Certificate::Certified) => EstimatorStatus::CERTIFICATE_CERTIFIED,
        Some(Certificate::NotCertified) => EstimatorStatus::CERTIFICATE_NOT_CERTIFIED,
        Some(Certificate::Replaced) => EstimatorStatus::CERTIFICATE_REPLACED,
    }
}

/// Writes an outcome with the numbers of its best fit; `row` has [`size`] bytes.
///
/// # Inputs
/// * `observed`: the observations that reached the solver.
pub fn write(
    row: &mut [u8],
    code: OutcomeCode,
    solution: Option<&Solution>,
    observed: &[Observation],
    ids: &[u32],
) {
    let mut row = Cursor { row, at: 0 };
    if let Some(solution) = solution
        && code == OutcomeCode::Ok
    {
        let (rotation, translation) = pose(solution);
        row.doubles(&rotation);
        row.doubles(&translation);
        row.doubles(&solution.covariance.row_major());
    } else {
        row.doubles(&[f64::NAN; 48]);
    }
    if let Some(solution) = solution {
        row.doubles(&[
            solution.rms_px,
            solution.chi_squared,
            solution.chi_squared_limit,
            solution.ambiguity,
        ]);
        row.bytes(&solution.degrees_of_freedom.to_ne_bytes());
        row.bytes(&solution.iterations.to_ne_bytes());
    } else {
        row.doubles(&[f64::NAN; 4]);
        row.bytes(&[0; 4]);
    }
    row.bytes(&[code.number(), solution.map_or(0, certificate)]);
    let mut observed = observed.iter().map(|seen| seen.id).peekable();
    for &id in ids {
        // Both are in the order of the arrays.
        let is_observed = observed.next_if_eq(&id).is_some();
        let is_used =
            solution.is_some_and(|solution| is_observed && !solution.excluded.contains(id));
        row.bytes(&[u8::from(is_used)]);
    }
    row.fill();
}

struct Cursor<'a> {
    row: &'a mut [u8],
    at: usize,
}

impl Cursor<'_> {
    fn bytes(&mut self, bytes: &[u8]) {
        if let Some(to) = self.row.get_mut(self.at..self.at + bytes.len()) {
            to.copy_from_slice(bytes);
        }
        self.at += bytes.len();
    }

    fn doubles(&mut self, numbers: &[f64]) {
        for number in numbers {
            self.bytes(&number.to_ne_bytes());
        }
    }

    fn fill(&mut self) {
        if let Some(rest) = self.row.get_mut(self.at..) {
            rest.fill(0);
        }
    }
}
