// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

//! The binding: borrows NumPy arrays, releases the GIL, maps errors. No numerics here.

use pyo3::prelude::*;

mod response;
mod solve;

#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    response::register(module)?;
    solve::register(module)?;
    Ok(())
}
