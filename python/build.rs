//! Arguments for the linker, where a module needs any.

fn main() {
    pyo3_build_config::add_extension_module_link_args();
}
