// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

use pyo3::prelude::*;

pub fn register(_module: &Bound<'_, PyModule>) -> PyResult<()> {
    Ok(())
}
