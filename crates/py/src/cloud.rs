//! Module `cloud`: the native object inside Python's `PointCloud`.

use crate::call::{call, in_pieces};
use crate::convert::{axes, holds, to_matrix, to_vector, values, vector};
use crate::error::raise;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use scansion_core::cloud::crs::contradiction;
use scansion_core::cloud::{Cloud as CoreCloud, CodeScheme, Column, Coordinates, OwnClass};
use scansion_core::io::{ProjectionRecord, WriteOptions, las_georeference};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Points with named columns, in the core's memory.
#[pyclass(module = "scansion._core")]
#[derive(Clone)]
pub(crate) struct Cloud {
    pub(crate) inner: Arc<CoreCloud>,
}

/// `(integers, scale, offset)` of a cloud that was read from LAS.
type Ticks<'py> = (Bound<'py, PyArray2<i32>>, [f64; 3], [f64; 3]);

#[pymethods]
impl Cloud {
    #[staticmethod]
    fn from_xyz(xyz: PyReadonlyArray2<'_, f64>) -> PyResult<Self> {
        Self::new(Coordinates::Float(axes(xyz.py(), &xyz, "xyz")?))
    }

    #[staticmethod]
    fn from_ticks(ticks: PyReadonlyArray2<'_, i32>, scale: [f64; 3], offset: [f64; 3]) -> PyResult<Self> {
        Self::new(Coordinates::Scaled { ticks: axes(ticks.py(), &ticks, "ticks")?, scale, offset })
    }

    fn __len__(&self) -> usize {
        self.inner.len()
    }

    fn copy(&self) -> Self {
        self.clone()
    }

    fn xyz<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let mut rows = Vec::with_capacity(3 * self.inner.len());
        in_pieces(py, self.inner.len(), |piece| rows.extend(piece.flat_map(|i| self.inner.xyz(i))))?;
        to_matrix(py, rows, 3)
    }

    /// One coordinate of all points: 0 is x, 1 is y, 2 is z.
    fn axis<'py>(&self, py: Python<'py>, axis: usize) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let mut values = Vec::with_capacity(self.inner.len());
        in_pieces(py, self.inner.len(), |piece| values.extend(piece.map(|i| self.inner.xyz(i)[axis.min(2)])))?;
        Ok(PyArray1::from_vec(py, values))
    }

    fn ticks<'py>(&self, py: Python<'py>) -> PyResult<Option<Ticks<'py>>> {
        match self.inner.coordinates() {
            Coordinates::Float(_) => Ok(None),
            Coordinates::Scaled { ticks: [x, y, z], scale, offset } => {
                let mut rows = Vec::with_capacity(3 * x.len());
                in_pieces(py, x.len(), |piece| rows.extend(piece.flat_map(|i| [x[i], y[i], z[i]])))?;
                Ok(Some((to_matrix(py, rows, 3)?, *scale, *offset)))
            }
        }
    }

    /// The points at these indices, in that order.
    fn select(&self, py: Python<'_>, indices: PyReadonlyArray1<'_, u32>) -> PyResult<Self> {
        let indices = vector(&indices, "indices")?;
        match indices.iter().find(|&&i| i as usize >= self.inner.len()) {
            Some(i) => Err(PyIndexError::new_err(format!("point {i} of {} points", self.inner.len()))),
            None => Ok(Self::of(py.detach(|| self.inner.select(indices)))),
        }
    }

    fn columns(&self) -> Vec<String> {
        self.inner.columns().iter().map(|c| c.name.clone()).collect()
    }

    fn column<'py>(&self, py: Python<'py>, name: &str) -> Option<Bound<'py, PyAny>> {
        self.inner.column(name).map(|c| to_vector(py, &c.values))
    }

    fn set_column(&mut self, name: &str, array: &Bound<'_, PyAny>) -> PyResult<()> {
        let column = Column::new(name, values(array, name)?);
        Arc::make_mut(&mut self.inner).set_column(column).map_err(raise)
    }

    /// Takes over what was written into the array of a column.
    fn update_column(&mut self, name: &str, array: &Bound<'_, PyAny>) -> PyResult<()> {
        match self.inner.column(name) {
            Some(column) if !holds(&column.values, array)? => self.set_column(name, array),
            _ => Ok(()),
        }
    }

    fn remove_column(&mut self, name: &str) -> bool {
        Arc::make_mut(&mut self.inner).take_column(name).is_some()
    }

    /// Scale and offset with which LAS stores the coordinates.
    fn las_frame(&self, py: Python<'_>) -> PyResult<([f64; 3], [f64; 3])> {
        let frame = py.detach(|| scansion_core::io::las_frame(&self.inner, &WriteOptions::default())).map_err(raise)?;
        Ok((frame.scale, frame.offset))
    }

    /// The reference system as WKT, if it is known.
    fn wkt(&self) -> Option<String> {
        self.inner.wkt()
    }

    /// The reference system as WKT for LAS; warns of what is lost.
    fn las_wkt(&self, py: Python<'_>) -> PyResult<Option<String>> {
        call(py, Some(1), |monitor| Ok(scansion_core::io::las_wkt(&self.inner, monitor)))
    }

    /// Takes over what the records of LAS with these numbers tell of the reference system and unit. `wkt`: the file says
    /// that WKT counts.
    fn take_las_records(&mut self, py: Python<'_>, records: Vec<(u16, Vec<u8>)>, wkt: bool) -> PyResult<()> {
        let records: Vec<_> = records.into_iter().map(|(id, data)| ProjectionRecord { id, data }).collect();
        let place = call(py, Some(1), |monitor| Ok(las_georeference(&records, wkt, monitor)))?;
        let cloud = Arc::make_mut(&mut self.inner);
        (cloud.crs, cloud.metres_per_unit) = (place.crs, place.metres_per_unit);
        cloud.take_unit_from_crs();
        Ok(())
    }

    #[getter]
    fn crs(&self) -> Option<String> {
        self.inner.crs.clone()
    }

    #[setter]
    fn set_crs(&mut self, crs: Option<String>) -> PyResult<()> {
        if let Some(problem) = crs.as_deref().and_then(contradiction) {
            return Err(PyValueError::new_err(format!("crs: {problem}")));
        }
        Arc::make_mut(&mut self.inner).set_crs(crs);
        Ok(())
    }

    #[getter]
    fn scheme(&self) -> &'static str {
        self.inner.scheme.name()
    }

    #[setter]
    fn set_scheme(&mut self, name: &str) -> PyResult<()> {
        let found = CodeScheme::named(name);
        let expected = CodeScheme::ALL.map(CodeScheme::name).join(", ");
        let wrong = || PyValueError::new_err(format!("scheme: found {name:?}, expected one of {expected}"));
        Arc::make_mut(&mut self.inner).scheme = found.ok_or_else(wrong)?;
        Ok(())
    }

    /// Names of codes that come before those of the list.
    #[getter]
    fn class_names(&self) -> BTreeMap<u8, String> {
        self.inner.class_names.iter().map(|(&code, own)| (code, own.name.clone())).collect()
    }

    #[setter]
    fn set_class_names(&mut self, names: BTreeMap<u8, String>) {
        let own = names.into_iter().map(|(code, name)| (code, OwnClass { name, colour: None }));
        Arc::make_mut(&mut self.inner).class_names = own.collect();
    }

    /// A list, not `bytes`, for Python.
    fn unlabelled(&self) -> Vec<u16> {
        self.inner.scheme.unlabelled().iter().map(|&code| u16::from(code)).collect()
    }

    #[getter]
    fn metres_per_unit(&self) -> Option<f64> {
        self.inner.metres_per_unit
    }

    #[setter]
    fn set_metres_per_unit(&mut self, metres: Option<f64>) -> PyResult<()> {
        if let Some(wrong) = metres.filter(|m| !(m.is_finite() && *m > 0.0)) {
            let text = format!("metres_per_unit: found {wrong}, expected a number above 0, finite");
            return Err(PyValueError::new_err(text));
        }
        Arc::make_mut(&mut self.inner).metres_per_unit = metres;
        Ok(())
    }
}

impl Cloud {
    pub(crate) fn of(cloud: CoreCloud) -> Self {
        Self { inner: Arc::new(cloud) }
    }

    fn new(coordinates: Coordinates) -> PyResult<Self> {
        CoreCloud::new(coordinates).map(Self::of).map_err(raise)
    }
}
