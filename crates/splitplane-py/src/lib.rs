//! What the Python package `splitplane` does in Rust: arrays in, arrays out. Its Python part
//! checks shapes and types and gives the arrays their names.

mod batch;
mod scenes;
mod tree;

use pyo3::prelude::*;

/// The module `splitplane._native`.
#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("DEFAULT_TREE", splitplane::TreeChoice::DEFAULT)?;
    module.add("MAX_SIDE", splitplane_lab::MAX_SIDE)?;
    module.add_class::<tree::Tree>()?;
    module.add_class::<scenes::Scene>()?;
    module.add_function(wrap_pyfunction!(scenes::load_scene, module)?)?;
    module.add_function(wrap_pyfunction!(scenes::trees, module)?)?;
    module.add_function(wrap_pyfunction!(scenes::compare, module)?)
}
