// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

use numpy::ndarray::{Array1, Array2, Array3};
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArray3, PyReadonlyArray1, PyReadonlyArray2,
    PyReadonlyArray3, PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use swatchwork_core::solve::blend::{
    Search, Texels, blend as blend_texels, blend_slots as blend_texel_slots,
};
use swatchwork_core::solve::hull::MOST;
use swatchwork_core::solve::joint;
use swatchwork_core::solve::nnls::{Quadratic, Status, Workspace};
use swatchwork_core::solve::problem::Problem;
use swatchwork_core::solve::representatives;

/// A matrix, a vector and a number beside them, as Python gets them.
type MatrixVector<'py, T> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>, T);

/// Index, weight, squared error and supports visited, as Python gets them.
type Slots<'py> = (
    Bound<'py, PyArray2<u32>>,
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray1<f64>>,
    u64,
);

/// Texels blended between two looks at Ctrl-C.
const STRIDE: usize = 4096;

fn invalid(message: String) -> PyErr {
    PyValueError::new_err(message)
}

/// A C-contiguous array's data, or an error that names the argument.
macro_rules! slice {
    ($array:expr, $name:literal) => {
        $array
            .as_slice()
            .map_err(|_| invalid(format!("{}: expected a C-contiguous array", $name)))
    };
}

fn finite(values: &[f64], name: &str) -> PyResult<()> {
    match values.iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(at) => Err(invalid(format!(
            "{name}: value {} at flat index {at}; expected finite values",
            values[at]
        ))),
    }
}

fn finite32(values: &[f32], name: &str) -> PyResult<()> {
    match values.iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(at) => Err(invalid(format!(
            "{name}: value {} at flat index {at}; expected finite values",
            values[at]
        ))),
    }
}

/// Offsets [M + 1] that rise from 0 to the number of pairs.
fn checked_offsets(offsets: &[i64], pairs: usize) -> PyResult<Vec<usize>> {
    let rising = offsets.windows(2).all(|w| w[0] <= w[1]);
    if offsets.first() != Some(&0) || offsets.last() != Some(&(pairs as i64)) || !rising {
        return Err(invalid(format!(
            "offsets: expected values that rise from 0 to the {pairs} pairs"
        )));
    }
    Ok(offsets.iter().map(|&o| o as usize).collect())
}

fn checked_weights<'a>(
    weights: &'a PyReadonlyArray2<f64>,
    texels: usize,
) -> PyResult<(&'a [f64], usize)> {
    let (rows, columns) = (weights.shape()[0], weights.shape()[1]);
    if rows != texels || columns == 0 || columns > MOST {
        return Err(invalid(format!(
            "weights: shape [{rows}, {columns}]; expected [{texels}, N] with N from 1 to {MOST}"
        )));
    }
    let values = slice!(weights, "weights")?;
    finite(values, "weights")?;
    Ok((values, columns))
}

/// Measurements and generic responses at the texels that take part (Eq. 5).
#[pyclass(frozen, module = "swatchwork._native")]
pub struct SolverProblem {
    inner: Problem,
}

#[pymethods]
impl SolverProblem {
    #[new]
    #[pyo3(signature = (responses, radiance, offsets, floor))]
    fn new(
        py: Python<'_>,
        responses: PyReadonlyArray3<f32>,
        radiance: PyReadonlyArray2<f32>,
        offsets: PyReadonlyArray1<i64>,
        floor: PyReadonlyArray1<f64>,
    ) -> PyResult<Self> {
        let shape = responses.shape();
        let (pairs, kernels) = (shape[0], shape[1]);
        if shape[2] != 3 || radiance.shape() != [pairs, 3] {
            return Err(invalid(format!(
                "responses {shape:?} and radiance {:?}: expected [P, J, 3] and [P, 3]",
                radiance.shape()
            )));
        }
        let offsets = checked_offsets(slice!(offsets, "offsets")?, pairs)?;
        let floor = slice!(floor, "floor")?;
        if floor.len() + 1 != offsets.len() || !floor.iter().all(|&f| f > 0.0) {
            return Err(invalid(format!(
                "floor: {} values; expected one above zero for each of the {} texels",
                floor.len(),
                offsets.len() - 1
            )));
        }
        let (responses, radiance) = (
            slice!(responses, "responses")?,
            slice!(radiance, "radiance")?,
        );
        finite32(responses, "responses")?;
        finite32(radiance, "radiance")?;
        let inner = py.detach(|| Problem::new(responses, radiance, offsets, kernels, floor));
        Ok(Self { inner })
    }

    /// gamma_x [M].
    #[getter]
    fn gamma<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.inner.gamma.clone().into_pyarray(py)
    }

    /// Responses [P, N, 3] of representatives [N, J, 3] (Eq. 14).
    fn fold<'py>(
        &self,
        py: Python<'py>,
        representatives: PyReadonlyArray3<f64>,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let n = self.check_representatives(&representatives)?;
        let values = slice!(representatives, "representatives")?;
        let out = py.detach(|| self.inner.fold(values));
        Ok(array3(out, [self.inner.pairs(), n, 3]).into_pyarray(py))
    }

    /// Optimal representatives for the given weights (Eqs. 6, 7): ([N, J, 3], data term, converged).
    fn representatives<'py>(
        &self,
        py: Python<'py>,
        weights: PyReadonlyArray2<f64>,
        start: PyReadonlyArray3<f64>,
    ) -> PyResult<(Bound<'py, PyArray3<f64>>, f64, bool)> {
        let (values, n) = checked_weights(&weights, self.inner.texels())?;
        if self.check_representatives(&start)? != n {
            return Err(invalid(format!(
                "start: expected {n} representatives, as many as weights"
            )));
        }
        let start = slice!(start, "start")?;
        let (out, value, status) =
            py.detach(|| representatives::optimise(&self.inner, values, n, start));
        let out = array3(out, [n, self.inner.kernels, 3]).into_pyarray(py);
        Ok((out, value, status == Status::Converged))
    }

    /// Representatives [N, J, 3] after a Gauss-Newton step that lets the weights follow.
    fn joint_step<'py>(
        &self,
        py: Python<'py>,
        weights: PyReadonlyArray2<f64>,
        representatives: PyReadonlyArray3<f64>,
        damping: f64,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let (values, n) = checked_weights(&weights, self.inner.texels())?;
        if self.check_representatives(&representatives)? != n {
            return Err(invalid(format!(
                "representatives: expected {n} of them, as many as weights"
            )));
        }
        if !(damping >= 0.0 && damping.is_finite()) {
            return Err(invalid(format!(
                "damping: {damping}; expected a finite number from 0 up"
            )));
        }
        let start = slice!(representatives, "representatives")?;
        let out = py.detach(|| joint::joint_step(&self.inner, values, start, damping));
        Ok(array3(out, [n, self.inner.kernels, 3]).into_pyarray(py))
    }

    /// Normal equations of one channel: (H [N J, N J], b [N J], c).
    fn normal_equations<'py>(
        &self,
        py: Python<'py>,
        weights: PyReadonlyArray2<f64>,
        channel: usize,
    ) -> PyResult<MatrixVector<'py, f64>> {
        let (values, n) = checked_weights(&weights, self.inner.texels())?;
        if channel > 2 {
            return Err(invalid(format!("channel: {channel}; expected 0, 1 or 2")));
        }
        let size = n * self.inner.kernels;
        let mut all = py.detach(|| representatives::normal_equations(&self.inner, values, n));
        let e = std::mem::replace(
            &mut all[channel],
            representatives::NormalEquations {
                h: vec![],
                b: vec![],
                c: 0.0,
            },
        );
        let h = Array2::from_shape_vec((size, size), e.h)
            .expect("size x size")
            .into_pyarray(py);
        Ok((h, e.b.into_pyarray(py), e.c))
    }
}

impl SolverProblem {
    fn check_representatives(&self, array: &PyReadonlyArray3<f64>) -> PyResult<usize> {
        let shape = array.shape();
        if shape[0] == 0 || shape[1] != self.inner.kernels || shape[2] != 3 {
            return Err(invalid(format!(
                "representatives: shape {shape:?}; expected [N, {}, 3]",
                self.inner.kernels
            )));
        }
        let values = slice!(array, "representatives")?;
        finite(values, "representatives")?;
        Ok(shape[0])
    }
}

fn array3<T>(values: Vec<T>, shape: [usize; 3]) -> Array3<T> {
    Array3::from_shape_vec(shape, values).expect("as many values as the shape holds")
}

/// Validated arguments of a blend.
struct BlendInput<'a> {
    responses: &'a [f32],
    radiance: &'a [f32],
    offsets: Vec<usize>,
    representatives: usize,
    search: Search,
}

impl<'a> BlendInput<'a> {
    fn new(
        responses: &'a PyReadonlyArray3<f32>,
        radiance: &'a PyReadonlyArray2<f32>,
        offsets: &PyReadonlyArray1<i64>,
        most: usize,
        search: Search,
    ) -> PyResult<Self> {
        let shape = responses.shape();
        let (pairs, n) = (shape[0], shape[1]);
        if shape[2] != 3 || radiance.shape() != [pairs, 3] || n == 0 || n > MOST || most == 0 {
            return Err(invalid(format!(
                "responses {shape:?}, radiance {:?}, most {most}: expected [P, N, 3] with N from 1 to {MOST}, [P, 3], at least 1",
                radiance.shape()
            )));
        }
        let offsets = checked_offsets(slice!(offsets, "offsets")?, pairs)?;
        let (responses, radiance) = (
            slice!(responses, "responses")?,
            slice!(radiance, "radiance")?,
        );
        finite32(responses, "responses")?;
        finite32(radiance, "radiance")?;
        Ok(Self {
            responses,
            radiance,
            offsets,
            representatives: n,
            search,
        })
    }

    fn texels(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Hand the texels over in strides, so that Ctrl-C gets through: the first texel of each, and its data.
    /// The pruned search samples all texels at once.
    fn in_strides(
        &self,
        py: Python<'_>,
        mut each: impl FnMut(usize, Texels) -> PyResult<()>,
    ) -> PyResult<()> {
        let texels = self.texels();
        let stride = match self.search {
            Search::Pruned { .. } => texels.max(1),
            _ => STRIDE,
        };
        let row = self.representatives * 3;
        for first in (0..texels).step_by(stride) {
            let last = (first + stride).min(texels);
            let (a, b) = (self.offsets[first], self.offsets[last]);
            let local: Vec<usize> = self.offsets[first..=last].iter().map(|o| o - a).collect();
            let part = Texels {
                responses: &self.responses[a * row..b * row],
                radiance: &self.radiance[a * 3..b * 3],
                offsets: &local,
                representatives: self.representatives,
            };
            each(first, part)?;
            py.check_signals()?;
        }
        Ok(())
    }
}

fn search_named(name: &str, sample: f64, cover: f64, seed: u64) -> PyResult<Search> {
    match name {
        "exact" => Ok(Search::Exact),
        "brute" => Ok(Search::Brute),
        "pruned" => Ok(Search::Pruned {
            sample,
            cover,
            seed,
        }),
        other => Err(invalid(format!(
            "search: '{other}'; expected exact, brute or pruned"
        ))),
    }
}

/// Best blends of at most `most` representatives at each texel (Eq. 12):
/// (weights [M, N], squared error [M], supports visited).
#[pyfunction]
#[pyo3(signature = (responses, radiance, offsets, most, search="exact", previous=None, sample=0.05, cover=0.99, seed=0))]
#[allow(clippy::too_many_arguments)] // keyword arguments in Python
fn blend<'py>(
    py: Python<'py>,
    responses: PyReadonlyArray3<f32>,
    radiance: PyReadonlyArray2<f32>,
    offsets: PyReadonlyArray1<i64>,
    most: usize,
    search: &str,
    previous: Option<PyReadonlyArray2<f64>>,
    sample: f64,
    cover: f64,
    seed: u64,
) -> PyResult<MatrixVector<'py, u64>> {
    let search = search_named(search, sample, cover, seed)?;
    let input = BlendInput::new(&responses, &radiance, &offsets, most, search)?;
    let (texels, n) = (input.texels(), input.representatives);
    let previous = match &previous {
        None => &[][..],
        Some(p) if p.shape() == [texels, n] => {
            let previous = slice!(p, "previous")?;
            finite(previous, "previous")?;
            previous
        }
        Some(p) => {
            return Err(invalid(format!(
                "previous: shape {:?}; expected [{texels}, {n}]",
                p.shape()
            )));
        }
    };
    let mut weights = Vec::with_capacity(texels * n);
    let mut error = Vec::with_capacity(texels);
    let mut visited = 0;
    input.in_strides(py, |first, part| {
        let last = first + part.offsets.len() - 1;
        let hint = previous.get(first * n..last * n).unwrap_or(&[]);
        let done = py.detach(|| blend_texels(&part, most, search, hint));
        weights.extend(done.weights);
        error.extend(done.error);
        visited += done.visited;
        Ok(())
    })?;
    let weights = Array2::from_shape_vec((texels, n), weights).expect("texels x n");
    Ok((
        weights.into_pyarray(py),
        Array1::from_vec(error).into_pyarray(py),
        visited,
    ))
}

/// The same as slots, the largest weight first: (index [M, most], weight [M, most], squared error [M],
/// supports visited).
#[pyfunction]
#[pyo3(signature = (responses, radiance, offsets, most, search="exact", sample=0.05, cover=0.99, seed=0))]
#[allow(clippy::too_many_arguments)] // keyword arguments in Python
fn blend_slots<'py>(
    py: Python<'py>,
    responses: PyReadonlyArray3<f32>,
    radiance: PyReadonlyArray2<f32>,
    offsets: PyReadonlyArray1<i64>,
    most: usize,
    search: &str,
    sample: f64,
    cover: f64,
    seed: u64,
) -> PyResult<Slots<'py>> {
    let search = search_named(search, sample, cover, seed)?;
    let input = BlendInput::new(&responses, &radiance, &offsets, most, search)?;
    let texels = input.texels();
    let mut index = Vec::with_capacity(texels * most);
    let mut weight = Vec::with_capacity(texels * most);
    let mut error = Vec::with_capacity(texels);
    let mut visited = 0;
    input.in_strides(py, |_, part| {
        let done = py.detach(|| blend_texel_slots(&part, most, search));
        index.extend(done.index);
        weight.extend(done.weight);
        error.extend(done.error);
        visited += done.visited;
        Ok(())
    })?;
    let index = Array2::from_shape_vec((texels, most), index).expect("texels x most");
    let weight = Array2::from_shape_vec((texels, most), weight).expect("texels x most");
    Ok((
        index.into_pyarray(py),
        weight.into_pyarray(py),
        Array1::from_vec(error).into_pyarray(py),
        visited,
    ))
}

/// Minimise 1/2 x'Hx - b'x over x >= 0 from `start`: (x, converged).
#[pyfunction]
fn nnls<'py>(
    py: Python<'py>,
    h: PyReadonlyArray2<f64>,
    b: PyReadonlyArray1<f64>,
    start: PyReadonlyArray1<f64>,
    tolerance: f64,
) -> PyResult<(Bound<'py, PyArray1<f64>>, bool)> {
    let size = b.shape()[0];
    if h.shape() != [size, size] || start.shape() != [size] {
        return Err(invalid(format!(
            "h {:?}, b {:?}, start {:?}: expected [S, S], [S], [S]",
            h.shape(),
            b.shape(),
            start.shape()
        )));
    }
    let (h, b) = (slice!(h, "h")?, slice!(b, "b")?);
    finite(h, "h")?;
    finite(b, "b")?;
    let mut x = slice!(start, "start")?.to_vec();
    finite(&x, "start")?;
    let status = py.detach(|| {
        let quadratic = Quadratic { h, b, block: size };
        Workspace::default().solve(&quadratic, &mut x, tolerance)
    });
    Ok((x.into_pyarray(py), status == Status::Converged))
}

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<SolverProblem>()?;
    module.add_function(wrap_pyfunction!(blend, module)?)?;
    module.add_function(wrap_pyfunction!(blend_slots, module)?)?;
    module.add_function(wrap_pyfunction!(nnls, module)?)?;
    Ok(())
}
