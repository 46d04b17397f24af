//! Passes on the linker arguments that a Python module needs on some platforms.

fn main() {
    pyo3_build_config::add_extension_module_link_args();
}
