//! Markers on the tanker: a checked map, or points of an array.

use std::path::PathBuf;

use nalgebra::Point3;
use numpy::PyArray2;
use numpy::PyUntypedArrayMethods;
use numpy::ndarray::Array2;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use tanker_pose::pipeline::Refusal;
use tanker_pose::target::{MAX_COORDINATE_M, MapBudget, MarkerMap};
use tanker_pose::text_file;

use crate::arrays::{doubles, ids as read_ids, json};
use crate::errors::value_error;

/// A checked marker map.
#[pyclass(frozen, name = "MarkerMap", module = "tanker_pose_estimator")]
pub struct PyMarkerMap {
    pub map: std::sync::Arc<MarkerMap>,
}

impl PyMarkerMap {
    fn new(map: MarkerMap) -> Self {
        Self {
            map: std::sync::Arc::new(map),
        }
    }
}

#[pymethods]
impl PyMarkerMap {
    /// A map that is shipped: "paper" or "fin6".
    #[staticmethod]
    fn shipped(name: &str) -> PyResult<Self> {
        let names = || MarkerMap::shipped_names().collect::<Vec<_>>().join(", ");
        let map = MarkerMap::shipped(name)
            .ok_or_else(|| value_error(format!("expected one of {}, got {name:?}", names())))?;
        Ok(Self::new(map))
    }

    /// A map from a YAML file, with the errors of survey and airframe that it states.
    #[staticmethod]
    fn from_file(path: PathBuf) -> PyResult<Self> {
        let text = text_file::read(&path)?;
        let map = MarkerMap::from_yaml(&text, &path.display().to_string()).map_err(value_error)?;
        Ok(Self::new(map))
    }

    /// A map from a dict with the keys of such a file: {"name": "kite", "markers": [{"id": 1, "x": 0.0, ...}, ...]}.
    #[staticmethod]
    fn from_dict(fields: &Bound<'_, PyDict>) -> PyResult<Self> {
        let text = json(fields)?;
        Ok(Self::new(
            MarkerMap::from_yaml(&text, "marker map").map_err(value_error)?,
        ))
    }

    /// The map's name.
    #[getter]
    fn name(&self) -> &str {
        self.map.name()
    }

    /// Marker ids, ascending.
    #[getter]
    fn ids(&self) -> Vec<u32> {
        self.map.markers().iter().map(|marker| marker.id).collect()
    }

    /// Positions (N, 3) in the order of ids: tanker frame (x forward, y left, z up), m.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let markers = self.map.markers();
        let points = Array2::from_shape_fn((markers.len(), 3), |(row, column)| {
            markers[row].marker_in_tanker[column]
        });
        PyArray2::from_owned_array(py, points)
    }

    fn __len__(&self) -> usize {
        self.map.markers().len()
    }

    fn __repr__(&self) -> String {
        format!(
            "MarkerMap({:?}, {} markers)",
            self.map.name(),
            self.map.markers().len()
        )
    }
}

/// The markers that detections are of.
pub struct Markers {
    /// In the order of the arrays.
    pub ids: Vec<u32>,
    /// Ascending id.
    sorted: Vec<(u32, Point3<f64>)>,
    pub budget: MapBudget,
}

impl Markers {
    /// Reads a map, or an array (N, 3) whose rows have these ids, or else 0 to N - 1.
    pub fn new(markers: &Bound<'_, PyAny>, ids: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let ids = ids.map(read_ids).transpose()?;
        let found = match markers.cast::<PyMarkerMap>() {
            Ok(map) => Self::of_map(&map.get().map, ids),
            Err(_) => Self::of_array(markers, ids)?,
        };
        let unknown: Vec<u32> = found
            .ids
            .iter()
            .copied()
            .filter(|&id| found.get(id).is_none())
            .collect();
        if !unknown.is_empty() {
            return Err(value_error(Refusal::UnknownId { ids: unknown }));
        }
        check_unique(&found.ids)?;
        Ok(found)
    }

    fn of_map(map: &MarkerMap, ids: Option<Vec<u32>>) -> Self {
        let all: Vec<(u32, Point3<f64>)> = map
            .markers()
            .iter()
            .map(|marker| (marker.id, marker.marker_in_tanker))
            .collect();
        Self {
            ids: ids.unwrap_or_else(|| all.iter().map(|(id, _)| *id).collect()),
            sorted: all,
            budget: map.budget().clone(),
        }
    }

    fn of_array(points: &Bound<'_, PyAny>, ids: Option<Vec<u32>>) -> PyResult<Self> {
        let array = doubles(points)?;
        let &[count, 3] = array.shape() else {
            return Err(value_error(format!(
                "markers: expected a MarkerMap or an array of shape (N, 3), got shape {:?}",
                array.shape()
            )));
        };
        let ids = match ids {
            Some(ids) => ids,
            None => (0..u32::try_from(count).map_err(value_error)?).collect(),
        };
        if ids.len() != count {
            return Err(value_error(format!(
                "ids: expected {count}, one a marker, got {}",
                ids.len()
            )));
        }
        let mut sorted = Vec::with_capacity(count);
        for (&id, row) in ids.iter().zip(array.as_slice()?.chunks_exact(3)) {
            let &[x, y, z] = row else { continue };
            if !row.iter().all(|value| value.abs() <= MAX_COORDINATE_M) {
                return Err(value_error(format!(
                    "point {id}: expected coordinates within {MAX_COORDINATE_M} m, got ({x:?}, {y:?}, {z:?})"
                )));
            }
            sorted.push((id, Point3::new(x, y, z)));
        }
        sorted.sort_by_key(|(id, _)| *id);
        Ok(Self {
            ids,
            sorted,
            budget: MapBudget::default(),
        })
    }

    /// Returns the position of a marker, tanker frame, m.
    pub fn get(&self, id: u32) -> Option<Point3<f64>> {
        let index = self.sorted.binary_search_by_key(&id, |(id, _)| *id).ok()?;
        Some(self.sorted[index].1)
    }
}

/// Checks that no id is there twice, in the words of a refusal.
fn check_unique(ids: &[u32]) -> PyResult<()> {
    let mut sorted = ids.to_vec();
    sorted.sort_unstable();
    match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(&[id, _]) => {
            let count = ids.iter().filter(|&&other| other == id).count();
            Err(value_error(Refusal::DuplicateId { id, count }))
        }
        _ => Ok(()),
    }
}
