// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! Binding of the rendering operator: arrays are borrowed, checked by name, and the GIL is released.

use numpy::{
    Element, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2,
    PyReadonlyArray3, PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use swatchwork_core::response::{
    Basis, Folded, InstructionSet, LightBins, Masking, Pairs, Pyramid, PyramidError, Ring, SHAPES,
    SpecularRow, generic_responses, representative_responses,
};

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyPyramid>()?;
    module.add_class::<RingBasis>()?;
    module.add_function(wrap_pyfunction!(instruction_sets, module)?)
}

fn bad(name: &str, what: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(format!("{name}: {what}"))
}

/// The values of a borrowed array, or an error that names the argument.
fn contiguous<'a, T: Element, D: numpy::ndarray::Dimension>(
    name: &str,
    array: &'a numpy::PyReadonlyArray<'_, T, D>,
) -> PyResult<&'a [T]> {
    array.as_slice().map_err(|_| {
        bad(
            name,
            "not C-contiguous; expected numpy.ascontiguousarray of it",
        )
    })
}

fn rows_of_three<'a>(name: &str, array: &'a PyReadonlyArray2<'_, f32>) -> PyResult<&'a [[f32; 3]]> {
    if array.shape()[1] != 3 {
        return Err(bad(
            name,
            format!("shape {:?}; expected [P, 3]", array.shape()),
        ));
    }
    let (rows, _) = contiguous(name, array)?.as_chunks::<3>();
    if let Some(at) = rows.iter().position(|v| !v.iter().all(|x| x.is_finite())) {
        return Err(bad(
            name,
            format!("row {at} is not finite ({:?})", rows[at]),
        ));
    }
    Ok(rows)
}

/// Mip levels of a world-frame environment on the equal-area octahedral square.
#[pyclass(name = "Pyramid", module = "swatchwork._native", frozen)]
pub struct PyPyramid(Pyramid);

#[pymethods]
impl PyPyramid {
    #[new]
    fn new(py: Python<'_>, base: PyReadonlyArray3<'_, f32>) -> PyResult<Self> {
        let shape = base.shape().to_vec();
        if shape[0] != shape[1] || shape[2] != 3 {
            return Err(bad("base", format!("shape {shape:?}; expected [S, S, 3]")));
        }
        let values = contiguous("base", &base)?;
        let size = shape[0];
        let made = py.detach(|| Pyramid::new(values, size));
        made.map(Self).map_err(|error| match error {
            PyramidError::Size(size) => bad(
                "base",
                format!("side {size}; expected a power of two of at least 2"),
            ),
            PyramidError::Value(at) => bad(
                "base",
                format!(
                    "{} at row {}, column {}; expected finite radiance of at least 0",
                    values[at],
                    at / 3 / size,
                    at / 3 % size
                ),
            ),
        })
    }

    /// Texels along a side of the base.
    #[getter]
    fn size(&self) -> usize {
        self.0.size()
    }

    /// Point lights: strong spots, and weaker ones that only the broadest lobes hand over.
    #[getter]
    fn lights(&self) -> [usize; 2] {
        self.0.light_counts()
    }
}

/// Instruction sets this machine has, the best last.
#[pyfunction]
fn instruction_sets() -> Vec<&'static str> {
    let available = InstructionSet::ALL
        .into_iter()
        .filter(|set| set.available());
    available.map(name_of).collect()
}

fn name_of(set: InstructionSet) -> &'static str {
    match set {
        InstructionSet::Baseline => "baseline",
        InstructionSet::Avx2 => "avx2",
        InstructionSet::Avx512 => "avx512",
    }
}

fn instruction_set(name: Option<&str>) -> PyResult<InstructionSet> {
    let Some(name) = name else {
        return Ok(InstructionSet::best());
    };
    let mut available = InstructionSet::ALL
        .into_iter()
        .filter(|set| set.available());
    available.find(|&set| name_of(set) == name).ok_or_else(|| {
        bad(
            "instruction_set",
            format!("{name:?}; expected one of {:?}", instruction_sets()),
        )
    })
}

fn masking(name: &str) -> PyResult<Masking> {
    let expected = || {
        bad(
            "maskings",
            format!("{name:?}; expected \"vgroove\" or \"smith:ALPHA\", ALPHA in (0, 1]"),
        )
    };
    if name == "vgroove" {
        return Ok(Masking::VGroove);
    }
    let alpha: f32 = name
        .strip_prefix("smith:")
        .and_then(|alpha| alpha.parse().ok())
        .ok_or_else(expected)?;
    if alpha > 0.0 && alpha <= 1.0 {
        Ok(Masking::Smith(alpha))
    } else {
        Err(expected())
    }
}

/// Generic kernels as rows over ring means and cosine integrals.
#[pyclass(module = "swatchwork._native", frozen)]
pub struct RingBasis(Basis);

/// Pairs between two looks at the signals: tens of milliseconds at most.
const PAIRS_A_SLICE: usize = 4096;

#[pymethods]
impl RingBasis {
    #[new]
    #[allow(clippy::too_many_arguments)]
    fn new(
        tangent: PyReadonlyArray1<'_, f32>,
        solid_angle: PyReadonlyArray1<'_, f32>,
        azimuths: PyReadonlyArray1<'_, u32>,
        layer: PyReadonlyArray1<'_, u32>,
        light_bins: (f32, f32, usize),
        maskings: Vec<String>,
        fresnel: Vec<u32>,
        plane: PyReadonlyArray1<'_, u32>,
        weights: PyReadonlyArray2<'_, f32>,
        diffuse: PyReadonlyArray2<'_, f32>,
    ) -> PyResult<Self> {
        let tangent = contiguous("tangent", &tangent)?;
        let solid_angle = contiguous("solid_angle", &solid_angle)?;
        let azimuths = contiguous("azimuths", &azimuths)?;
        let layer = contiguous("layer", &layer)?;
        let plane = contiguous("plane", &plane)?;
        if solid_angle.len() != tangent.len()
            || azimuths.len() != tangent.len()
            || layer.len() != tangent.len()
        {
            return Err(bad(
                "tangent",
                "solid_angle, azimuths and layer must have its length",
            ));
        }
        let (first, factor, count) = light_bins;
        let entries = tangent.len() + 2 * count;
        if weights.shape() != [plane.len(), entries] {
            return Err(bad(
                "weights",
                format!(
                    "shape {:?}; expected [{}, {entries}]",
                    weights.shape(),
                    plane.len()
                ),
            ));
        }
        if diffuse.shape()[1] != SHAPES * SHAPES {
            return Err(bad(
                "diffuse",
                format!(
                    "shape {:?}; expected [D, {}]",
                    diffuse.shape(),
                    SHAPES * SHAPES
                ),
            ));
        }
        let rings = (0..tangent.len()).map(|r| Ring {
            tangent: tangent[r],
            azimuths: azimuths[r],
            solid_angle: solid_angle[r],
            layer: layer[r] as usize,
        });
        let rows = contiguous("weights", &weights)?.chunks_exact(entries.max(1));
        let specular = plane.iter().zip(rows).map(|(&plane, row)| SpecularRow {
            plane: plane as usize,
            weights: row.to_vec(),
        });
        let diffuse = contiguous("diffuse", &diffuse)?
            .as_chunks::<{ SHAPES * SHAPES }>()
            .0
            .to_vec();
        let maskings = maskings
            .iter()
            .map(|name| masking(name))
            .collect::<PyResult<_>>()?;
        let light_bins = LightBins {
            first,
            factor,
            count,
        };
        Basis::new(
            rings.collect(),
            light_bins,
            maskings,
            fresnel,
            specular.collect(),
            diffuse,
        )
        .map(Self)
        .map_err(|error| PyValueError::new_err(error.0))
    }

    /// Generic kernels a channel, J.
    #[getter]
    fn kernels(&self) -> usize {
        self.0.kernels()
    }

    /// Environment lookups a pair costs.
    #[getter]
    fn lookups(&self) -> usize {
        self.0.lookups()
    }

    /// Responses [P, J, 3] of the generic kernels.
    #[pyo3(signature = (pyramid, normal, to_viewer, sky, sky_row, instruction_set=None))]
    #[allow(clippy::too_many_arguments)]
    fn generic_responses<'py>(
        &self,
        py: Python<'py>,
        pyramid: &PyPyramid,
        normal: PyReadonlyArray2<'py, f32>,
        to_viewer: PyReadonlyArray2<'py, f32>,
        sky: PyReadonlyArray2<'py, u64>,
        sky_row: PyReadonlyArray1<'py, i32>,
        instruction_set: Option<&str>,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let set = self::instruction_set(instruction_set)?;
        let pairs = checked_pairs(&normal, &to_viewer, &sky, &sky_row)?;
        let rows = self.0.kernels();
        in_slices(py, pairs, rows, |pairs, out| {
            generic_responses(&self.0, &pyramid.0, pairs, set, out);
        })
    }

    /// Responses [P, N, 3] of representatives [N, J, 3].
    #[pyo3(signature = (representatives, pyramid, normal, to_viewer, sky, sky_row, instruction_set=None))]
    #[allow(clippy::too_many_arguments)]
    fn representative_responses<'py>(
        &self,
        py: Python<'py>,
        representatives: PyReadonlyArray3<'py, f64>,
        pyramid: &PyPyramid,
        normal: PyReadonlyArray2<'py, f32>,
        to_viewer: PyReadonlyArray2<'py, f32>,
        sky: PyReadonlyArray2<'py, u64>,
        sky_row: PyReadonlyArray1<'py, i32>,
        instruction_set: Option<&str>,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let set = self::instruction_set(instruction_set)?;
        let pairs = checked_pairs(&normal, &to_viewer, &sky, &sky_row)?;
        let shape = representatives.shape();
        if shape[1..] != [self.0.kernels(), 3] {
            return Err(bad(
                "representatives",
                format!("shape {shape:?}; expected [N, {}, 3]", self.0.kernels()),
            ));
        }
        let weights = contiguous("representatives", &representatives)?;
        if let Some(at) = weights.iter().position(|w| !w.is_finite()) {
            return Err(bad(
                "representatives",
                format!(
                    "{} in representative {}",
                    weights[at],
                    at / (3 * self.0.kernels())
                ),
            ));
        }
        let folded = Folded::new(&self.0, weights);
        in_slices(py, pairs, folded.count(), |pairs, out| {
            representative_responses(&self.0, &folded, &pyramid.0, pairs, set, out);
        })
    }
}

fn checked_pairs<'a>(
    normal: &'a PyReadonlyArray2<'_, f32>,
    to_viewer: &'a PyReadonlyArray2<'_, f32>,
    sky: &'a PyReadonlyArray2<'_, u64>,
    sky_row: &'a PyReadonlyArray1<'_, i32>,
) -> PyResult<Pairs<'a>> {
    let normal = rows_of_three("normal", normal)?;
    let to_viewer = rows_of_three("to_viewer", to_viewer)?;
    if to_viewer.len() != normal.len() {
        return Err(bad(
            "to_viewer",
            format!(
                "{} rows; expected {}, as in normal",
                to_viewer.len(),
                normal.len()
            ),
        ));
    }
    if sky.shape()[1] != 64 {
        return Err(bad(
            "sky",
            format!("shape {:?}; expected [Q, 64]", sky.shape()),
        ));
    }
    let masks = sky.shape()[0];
    let sky = contiguous("sky", sky)?;
    let sky_row = contiguous("sky_row", sky_row)?;
    if sky_row.len() != normal.len() {
        return Err(bad(
            "sky_row",
            format!(
                "{} rows; expected {}, as in normal",
                sky_row.len(),
                normal.len()
            ),
        ));
    }
    if let Some(at) = sky_row
        .iter()
        .position(|&row| row < -1 || row >= masks as i32)
    {
        return Err(bad(
            "sky_row",
            format!(
                "{} at {at}; expected -1 or a row of the {masks} sky masks",
                sky_row[at]
            ),
        ));
    }
    Ok(Pairs {
        normal,
        to_viewer,
        sky_row,
        sky,
    })
}

/// Runs `compute` over slices of the pairs without the GIL, and looks for Ctrl-C between them.
fn in_slices<'py>(
    py: Python<'py>,
    pairs: Pairs<'_>,
    rows: usize,
    compute: impl Fn(Pairs<'_>, &mut [f32]) + Sync,
) -> PyResult<Bound<'py, PyArray3<f32>>> {
    let count = pairs.normal.len();
    let out = PyArray2::<f32>::zeros(py, [count, rows * 3], false);
    {
        let mut borrowed = out.readwrite();
        let values = borrowed.as_slice_mut().expect("a new array is contiguous");
        for first in (0..count).step_by(PAIRS_A_SLICE) {
            let last = (first + PAIRS_A_SLICE).min(count);
            let slice = Pairs {
                normal: &pairs.normal[first..last],
                to_viewer: &pairs.to_viewer[first..last],
                sky_row: &pairs.sky_row[first..last],
                sky: pairs.sky,
            };
            let part = &mut values[first * rows * 3..last * rows * 3];
            py.detach(|| compute(slice, part));
            py.check_signals()?;
        }
    }
    out.reshape([count, rows, 3])
}
