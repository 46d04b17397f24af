//! The module is built as a file that Python can load. The tests of the package itself are in `tests/python`.

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};

#[test]
fn the_module_is_built() {
    // The test and the module are in the same folder of the build.
    let test = std::env::current_exe().expect("the path of this test");
    let folder = test.parent().expect("the folder of the build");
    let library = folder.join(format!("{DLL_PREFIX}_mpm{DLL_SUFFIX}"));
    let bytes = std::fs::read(&library).unwrap_or_else(|error| panic!("{}: {error}", library.display()));
    let entry = b"PyInit__mpm";
    assert!(bytes.windows(entry.len()).any(|window| window == entry), "{}", library.display());
}
